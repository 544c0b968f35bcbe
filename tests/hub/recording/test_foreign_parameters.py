"""Every parameter that can name a file or a class, wherever a recording has it, for every command."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from hub.command_line.app import app
from hub.fork import Fork
from hub.planning import registry
from hub.planning.scenario_file import load
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.session.launch import attachments_of, plan_of
from hub.verify import verify
from schemas.codec import encode
from schemas.errors import RecordingError, TrustError
from schemas.keys import Keys, topic
from schemas.trocar_msgs import GrantMessage
from webconsole.recorded import Recorded
from webconsole.stage import Stage

SCENARIO = """\
name: guest
step: 1 ms
duration: 1 s
participants:
  robot: {kind: mujoco, looks: false, arms: {PSM1: {instrument: "400006"}}}
  task: {kind: practice-task, arms: {PSM1: {instrument: "400006"}}}
connections:
  - robot.PSM1/measured_cp -> task.PSM1/measured_cp
"""
FOREIGN = "from pathlib import Path\nPath(__file__).with_name('ran').touch()\n"
BASES: dict[str, dict[str, Any]] = {
    "bullet": {"organs": {"a": {"young_modulus": "10 kPa", "anchors": []}}},
    "ros-bag": {"arms": {"PSM1": {"instrument": "400006"}}, "listen": ["PSM1"]},
}
"""Parameters without which a kind is refused before it looks at a path."""
_PATHS = ("path", "file-path", "directory-path")

Part = Mapping[str, Any]


def fields(schema: Part, known: Part, at: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield the place of every path in a JSON schema."""
    if schema.get("format") in _PATHS:
        yield at
    if "$ref" in schema:
        yield from fields(known[schema["$ref"].removeprefix("#/$defs/")], known, at)
    for alternatives in ("anyOf", "oneOf", "allOf"):
        for one in schema.get(alternatives, ()):
            yield from fields(one, known, at)
    for name, one in schema.get("properties", {}).items():
        yield from fields(one, known, (*at, name))
    for one in (schema.get("additionalProperties"), *schema.get("patternProperties", {}).values()):
        if isinstance(one, dict):
            yield from fields(one, known, (*at, "a"))


def places() -> list[tuple[str, tuple[str, ...]]]:
    """Return kind and place of every path of every installed kind; of a field of all arms that of one."""
    found: set[tuple[str, tuple[str, ...]]] = set()
    for kind in registry.kinds():
        schema = registry.load(kind).params_model.model_json_schema()
        found |= {(kind, at) for at in fields(schema, schema.get("$defs", {}))}
    others = {("arms", arm) for arm in ("ECM", "PSM2", "PSM3")}
    return sorted(one for one in found if one[1][:2] not in others)


PLACES = places()


def with_value(params: Part, at: tuple[str, ...], value: str) -> dict[str, Any]:
    """Return parameters with a value at a place."""
    name, *rest = at
    inner = value if not rest else with_value(params.get(name, {}), tuple(rest), value)
    return {**params, name: inner}


class Guest:
    """Makes recordings that nobody has run: a scenario, a plan and one grant, with changes."""

    def __init__(self, directory: Path, attachments: Mapping[str, bytes]) -> None:
        self.directory = directory
        (directory / "foreign.py").write_text(FOREIGN)
        self._attachments = attachments
        self._made = 0

    def add(
        self, kind: str, params: Part, *, planned_kind: str | None = None, before: Part | None = None
    ) -> Recording:
        """Return a recording with one more participant; `before` are its parameters before a fork."""
        self._made += 1
        place = self.directory / f"run{self._made}"
        scenario, plan = (json.loads(self._attachments[f"{part}.json"]) for part in ("scenario", "plan"))
        scenario["participants"]["guest"] = {"kind": kind, "host": "hub", **params}
        role = registry.find(kind).role if ":" not in kind else "engine"
        if planned_kind != "":
            plan["participants"]["guest"] = {
                "name": "guest",
                "kind": planned_kind or kind,
                "role": role,
                "host": "hub",
                "period": 1,
                "ports": [],
            }
            plan["order"] += ["guest"] if role != "device" else []
        attachments = dict(self._attachments) | {
            "scenario.json": json.dumps(scenario).encode(),
            "plan.json": json.dumps(plan).encode(),
        }
        if before is not None:
            origin = {"parent": "x", "parent_run": "1", "step": 2, "time_ns": 2_000_000}
            renewal = {"step": 2, "before": {"guest": before}}
            attachments["fork.json"] = json.dumps({**origin, "renewals": [renewal]}).encode()
        with Recorder(place, attachments=attachments) as recorder:
            channel = recorder.add_channel(topic(Keys("guest").grant), GrantMessage.ros_type)
            for step in range(4):
                grant = GrantMessage(
                    run=1, epoch=0, step=step, start_ns=step * 10**6, horizon_ns=(step + 1) * 10**6, inlets=[]
                )
                recorder.write(channel, step * 10**6, encode(grant))
        return Recording(place)


@pytest.fixture(scope="module")
def attachments(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, bytes]:
    """What a recording of the scenario holds beside its messages."""
    scenario = tmp_path_factory.mktemp("guest") / "scenario.yaml"
    scenario.write_text(SCENARIO)
    file = load(str(scenario))
    return attachments_of(file.scenario, plan_of(file.scenario, file.params)[0], file)


@pytest.fixture
def guest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, attachments: Mapping[str, bytes]) -> Guest:
    monkeypatch.syspath_prepend(tmp_path)
    return Guest(tmp_path, attachments)


_opened: list[str] = []
_watched: list[str] = []


def _note_openings(event: str, arguments: tuple[Any, ...]) -> None:
    """An audit hook, which cannot be taken away again."""
    if _watched and event in ("open", "ctypes.dlopen") and any(one in str(arguments[0]) for one in _watched):
        _opened.append(f"{event} {arguments[0]}")
        raise PermissionError("a foreign file is opened")


@pytest.fixture(scope="module")
def hook() -> None:
    sys.addaudithook(_note_openings)


@pytest.fixture
def pipe(tmp_path: Path, hook: None) -> Iterator[Path]:
    """A named pipe that nobody writes to: who opens it waits for ever, so that the test ends it instead."""
    file = tmp_path / "foreign.pipe"
    os.mkfifo(file)
    _opened.clear()
    _watched.append(str(file))
    yield file
    _watched.clear()


def _fork(recording: Recording) -> None:
    Fork(recording, 3_000_000, endpoint="tcp/127.0.0.1:0")


def _view(recording: Recording) -> None:
    source = Recorded(recording.file)
    assert source.scenario is not None
    Stage(source.scenario, source.outlets, source.params)
    for name in recording.scenario().participants:
        source.params(name)


def _invoke(*words: str) -> Callable[[Recording], None]:
    def run(recording: Recording) -> None:
        given = [word.format(file=recording.file.parent, out=recording.file.parent / "out") for word in words]
        result = CliRunner().invoke(app, given)
        assert "Usage:" not in result.output
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception

    return run


COMMANDS: dict[str, Callable[[Recording], object]] = {
    "verify": verify,
    "fork": _fork,
    "view": _view,
    "score": _invoke("score", "{file}"),
    "render": _invoke("render", "{file}", "-o", "{out}.png", "--robot", "guest"),
    "dataset": _invoke("dataset", "{file}", "-o", "{out}"),
    "report": _invoke("report", "{file}", "-o", "{out}.html"),
    "ros bag": _invoke("ros", "bag", "{file}", "-o", "{out}.bag"),
    "forks": _invoke("forks", "{file}"),
    "recover": _invoke("recover", "{file}", "-o", "{out}.whole"),
}


def _tried(recording: Recording, *commands: str) -> dict[str, Exception | None]:
    """Return what each command says to a recording."""
    found: dict[str, Exception | None] = {}
    for name in commands or COMMANDS:
        try:
            COMMANDS[name](recording)
            found[name] = None
        except Exception as error:  # noqa: BLE001  # judged by the tests
            found[name] = error
    return found


def _expect_nothing_opened(
    guest: Guest, pipe: Path, place: tuple[str, tuple[str, ...]], commands: Iterable[str]
) -> None:
    """Name the pipe at a place of a recording, and try the commands."""
    kind, at = place
    stepped = registry.find(kind).role != "device"
    bad = with_value(BASES.get(kind, {}), at, str(pipe))
    found = _tried(guest.add(kind, bad), *(one for one in commands if stepped or one != "verify"))
    assert isinstance(found["fork"], TrustError)
    assert not stepped or isinstance(found["verify"], TrustError)
    assert _opened == []


@pytest.mark.parametrize("place", PLACES, ids=str)
def test_a_file_that_a_recording_names_is_not_trusted(
    guest: Guest, pipe: Path, place: tuple[str, tuple[str, ...]]
) -> None:
    """Wherever it is named, of now or of before a fork."""
    _expect_nothing_opened(guest, pipe, place, ("fork", "verify"))
    kind, at = place
    base = BASES.get(kind, {})
    commands = ("fork", "verify") if registry.find(kind).role != "device" else ("fork",)
    earlier = _tried(guest.add(kind, base, before=with_value(base, at, str(pipe))), *commands)
    assert all(isinstance(error, TrustError) for error in earlier.values())
    assert _opened == []


@pytest.mark.parametrize("place", {kind: (kind, at) for kind, at in PLACES}.values(), ids=str)
def test_no_command_opens_a_file_of_a_kind(
    guest: Guest, pipe: Path, place: tuple[str, tuple[str, ...]]
) -> None:
    _expect_nothing_opened(guest, pipe, place, COMMANDS)


@pytest.mark.search
@pytest.mark.parametrize("place", PLACES, ids=str)
def test_no_command_opens_a_file_that_a_recording_names(
    guest: Guest, pipe: Path, place: tuple[str, tuple[str, ...]]
) -> None:
    _expect_nothing_opened(guest, pipe, place, COMMANDS)


@pytest.mark.parametrize(
    ("scenario", "plan"),
    [("foreign:X", None), ("foreign:X", "practice-task"), ("practice-task", "foreign:X"), ("foreign:X", "")],
    ids=["both", "scenario alone", "plan alone", "not planned"],
)
def test_no_command_imports_a_class_that_a_recording_names(
    guest: Guest, scenario: str, plan: str | None
) -> None:
    found = _tried(guest.add(scenario, {}, planned_kind=plan))
    assert isinstance(found["fork"], TrustError | RecordingError)
    assert not (guest.directory / "ran").exists()


def test_a_renewal_has_no_kind(guest: Guest) -> None:
    """It would take the place of the participant's own."""
    before = {"arms": {"PSM1": {"instrument": "400006"}}, "kind": "foreign:X"}
    found = _tried(guest.add("practice-task", {"arms": before["arms"]}, before=before), "fork", "verify")
    assert all("kind is no parameter" in str(error) for error in found.values())
    assert not (guest.directory / "ran").exists()


def test_what_stands_in_another_file_is_shown_to_nobody(guest: Guest) -> None:
    (guest.directory / "secret.yaml").write_text("secret: of somebody")
    arms = {"PSM1": {"instrument": "400006", "dynamics": "secret.yaml"}}
    recording = guest.add("mujoco", {"arms": arms})
    source = Recorded(recording.file)
    assert source.scenario is not None
    notes = Stage(source.scenario, source.outlets, source.params).notes
    assert any("secret.yaml" in note for note in notes)
    assert not any("of somebody" in note for note in notes)
    assert "of somebody" not in str(_tried(recording))


def test_parameters_are_built_from_three_sources_alone() -> None:
    """A scenario of the user, a hub that was joined, and the trust check; who adds another answers for it."""
    root = Path(__file__).parents[3]
    product = ("hub", "tasks", "learning", "webconsole", "engines", "controllers", "devices", "trocar")
    makers = {
        str(file.relative_to(root))
        for package in product
        for file in (root / package).rglob("*.py")
        if "SessionParameters(" in file.read_text() or "SessionParameters.of_scenario(" in file.read_text()
    }
    assert makers == {
        "hub/fork.py",  # of the scenario that the user has changed, after the trust check
        "hub/hosting/host_run.py",
        "hub/recording/trust.py",
        "hub/remote/device_host.py",
        "hub/session/run.py",
        "tasks/recorded/session.py",  # of an own kind, with the files of the recording
        "webconsole/live.py",
    }
