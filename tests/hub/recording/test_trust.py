"""A stranger's recording is only data: it builds installed kinds, and reads files with recorded contents."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from hub.command_line import main
from hub.command_line.display import show
from hub.planning.scenario_file import load
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.errors import RecordingError, ScenarioError, TrustError
from tests.engines.fmus import build
from tests.hub.sample_session import write_session

INSTALLED = """
import ctypes
from pathlib import Path

from hub.participant import Device, Params, Stepped


class Quiet(Stepped):
    ports = ()

    def configure(self, setup):
        return {}

    def step(self, t, h, inputs):
        return {}

    def state_hash(self):
        return 1

    def close(self):
        pass


class PlantParams(Params):
    native_code = ("library",)
    library: Path | None = None


class Plant(Quiet):
    params_model = PlantParams

    def configure(self, setup):
        if self.params.library:
            ctypes.CDLL(str(setup.directory / self.params.library))
        return {}


class ReaderParams(Params):
    files: dict[str, Path] = {}


class Reader(Quiet):
    params_model = ReaderParams

    def configure(self, setup):
        for file in self.params.files.values():
            (setup.directory / "read").write_text((setup.directory / file).read_text())
        return {}


class Hand(Device):
    params_model = PlantParams
    ports = ()

    def open(self, directory):
        ctypes.CDLL(str(directory / self.params.library))

    def read(self, t):
        return ()

    def write(self, inputs):
        pass

    def close(self):
        pass
"""
"""The module of an installed package; `read` is what has been read."""

FOREIGN = """
from pathlib import Path
(Path(__file__).parent / "ran").touch()
from installed import Quiet, Reader
"""
"""A module on PYTHONPATH that leaves a mark when it is imported."""

LIBRARY = (
    '#include <stdio.h>\n__attribute__((constructor)) static void run(void) { fclose(fopen("%s", "w")); }\n'
)

SCENARIO = """\
name: guest
step: 1 ms
duration: 4 ms
participants:
  one: {kind: plant}
  two: {kind: reader, files: {a: known.txt}}
"""

Stranger = Callable[..., Recording]


@pytest.fixture
def place(
    install_plugin: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Path]:
    """A directory on PYTHONPATH with a foreign module, a library, a secret, a link to it and a known file."""
    kinds = {"plant": "installed:Plant", "reader": "installed:Reader"}
    entries = {"trocar.engines": kinds, "trocar.devices": {"stranger_hand": "installed:Hand"}}
    install_plugin("installed", entries, text=INSTALLED)
    place = tmp_path / "place"
    (place / "package").mkdir(parents=True)
    for name in ("foreign", "package/__init__", "package/__main__"):
        (place / f"{name}.py").write_text(FOREIGN)
    monkeypatch.syspath_prepend(place)
    paths = (place, tmp_path / "site_installed", os.environ.get("PYTHONPATH", ""))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(map(str, paths)))
    for name, text in (("secret.txt", "secret"), ("known.txt", "known")):
        (place / name).write_text(text)
    (place / "link.txt").symlink_to(place / "secret.txt")
    (place / "session.yaml").write_text(SCENARIO)
    yield place
    for name in ("foreign", "package", "package.__main__"):
        sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def once() -> dict[str, Recording]:
    """The recording that all tests start from, as soon as one of them has made it."""
    return {}


@pytest.fixture
def stranger(
    place: Path, tmp_path: Path, once: dict[str, Recording], tmp_path_factory: pytest.TempPathFactory
) -> Stranger:
    """Return a function that makes a recording with other participants in its scenario and its plan."""
    if not once:
        directory = tmp_path_factory.mktemp("session") / "true"
        launch(load(str(place / "session.yaml")), record=directory).run()
        (place / "read").unlink()
        once["true"] = Recording(directory)
    true = once["true"]

    def make(
        name: str = "one",
        plan: Mapping[str, Any] | None = None,
        directory: str = str(place),
        host: str = "hub",
        **spec: Any,
    ) -> Recording:
        scenario, planned, origin = (
            json.loads(true.attachments[f"{part}.json"]) for part in ("scenario", "plan", "origin")
        )
        planned["participants"]["two"]["host"] = host
        own = scenario["participants"].setdefault(name, {"host": "hub"})
        own |= spec
        new = planned["participants"].setdefault(name, {"role": "engine", "host": "hub", "period": 1})
        new |= {"name": name, "kind": own["kind"], "ports": [], **(plan or {})}
        if new["role"] == "engine" and name not in planned["order"]:
            planned["order"].append(name)
        origin["directory"] = directory
        attachments = {
            f"{part}.json": json.dumps(content).encode()
            for part, content in (("scenario", scenario), ("plan", planned), ("origin", origin))
        }
        with Recorder(tmp_path / "strange", attachments={**true.attachments, **attachments}) as recorder:
            channels = {topic: recorder.add_channel(topic, kind) for topic, kind in true.topics.items()}
            for message in true.messages():
                recorder.write(channels[message.topic], message.time_ns, message.payload)
        return Recording(tmp_path / "strange")

    return make


def left(place: Path) -> set[str]:
    """Return what code that has run, or a file that was read, has left behind."""
    return {path.name for path in place.rglob("*") if path.name in {"ran", "read"}}


def compiled(place: Path) -> None:
    """Write a library to `place` that leaves a mark when it is loaded."""
    (place / "library.c").write_text(LIBRARY % (place / "ran"))
    library = str(place / "library.so")
    subprocess.run(
        [str(build.COMPILER), "-shared", "-fPIC", str(place / "library.c"), "-o", library], check=True
    )


ASKS: dict[str, tuple[dict[str, Any], str, set[str]]] = {
    "a class": ({"kind": "foreign:Quiet"}, "the class 'foreign:Quiet', which no installed", {"ran"}),
    "a class in another process": (
        {"name": "two", "kind": "foreign:Reader", "host": "side"},
        "the class 'foreign:Reader', which no installed package has as a kind (participant 'two')",
        {"ran", "read"},
    ),
    "a library": ({"library": "library.so"}, "native code in '{place}/library.so'", {"ran"}),
    "another file": (
        {"name": "two", "files": {"a": "known.txt", "b": "secret.txt"}},
        "the file '{place}/secret.txt', which is missing or has other contents than those recorded",
        {"read"},
    ),
    "a path outside": ({"name": "two", "files": {"a": "../../etc/hostname"}}, "etc/hostname'", set()),
    "a link": ({"name": "two", "files": {"a": "link.txt"}}, "the file '{place}/link.txt'", {"read"}),
    "another machine": (
        {"name": "two", "files": {"a": "//elsewhere/share/known.txt"}},
        "the network path '//elsewhere/share/known.txt'",
        set(),
    ),
    "a directory on another machine": (
        {"directory": "\\\\elsewhere\\share"},
        r"the network path '\\elsewhere\share'",
        set(),
    ),
}
"""What a recording has instead; what the message lists; and what is left behind with trust."""


@pytest.mark.parametrize("case", ASKS)
def test_what_it_asks_for_is_listed_and_nothing_runs_or_is_read(
    stranger: Stranger, place: Path, case: str
) -> None:
    spec, listed, _ = ASKS[case]
    with pytest.raises(TrustError) as caught:
        verify(stranger(**spec))
    assert listed.format(place=place) in str(caught.value)
    assert "allow it with --trust (in Python: trust=True)" in str(caught.value)
    assert left(place) == set()


@pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)
@pytest.mark.parametrize("case", [case for case, (_, _, marks) in ASKS.items() if marks])
def test_with_trust_it_runs(stranger: Stranger, place: Path, case: str) -> None:
    compiled(place)
    spec, _, marks = ASKS[case]
    assert verify(stranger(**spec), trust=True).same
    assert marks <= left(place)


def test_the_program_of_a_package_does_not_run_even_with_trust(stranger: Stranger, place: Path) -> None:
    recording = stranger(kind="package.__main__:Quiet")
    with pytest.raises(TrustError, match=r"the class 'package\.__main__:Quiet'"):
        verify(recording)
    with pytest.raises(ScenarioError, match=r"'package\.__main__' is a program"):
        verify(recording, trust=True)
    assert left(place) == set()


def test_everything_is_listed_at_once(stranger: Stranger, place: Path) -> None:
    recording = stranger(name="three", kind="foreign:Quiet", files={"a": "//elsewhere/x"})
    with pytest.raises(TrustError, match=r"the class 'foreign:Quiet'.*\(participant 'three'\); the network"):
        verify(recording)


def test_ones_own_session_of_installed_kinds_needs_no_trust(stranger: Stranger, place: Path) -> None:
    assert verify(stranger()).same
    assert (place / "read").read_text() == "known"


def test_recorded_files_are_found_in_a_directory_that_the_user_names(
    stranger: Stranger, place: Path, tmp_path: Path
) -> None:
    recording = stranger(directory="/home/someone/else")
    with pytest.raises(TrustError, match=r"the file '/home/someone/else/known\.txt', which is missing"):
        verify(recording)
    assert verify(recording, directory=place).same
    (place / "known.txt").write_text("something else")
    with pytest.raises(TrustError, match=f"the file '{place}/known.txt'"):
        verify(recording, directory=place)


@pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)
@pytest.mark.parametrize("host", ["hub", "side"])
def test_the_library_of_a_device_is_not_loaded(stranger: Stranger, place: Path, host: str) -> None:
    """Also not where the device shares a host with an engine, whose process is needed."""
    compiled(place)
    recording = stranger(
        name="hand",
        kind="stranger_hand",
        library="library.so",
        plan={"role": "device", "host": host},
        host=host,
    )
    assert verify(recording).same
    assert "ran" not in left(place)


@pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)
@pytest.mark.parametrize("host", ["hub", "side"])
def test_a_device_that_the_plan_has_as_an_engine(stranger: Stranger, place: Path, host: str) -> None:
    """A host process would open it."""
    compiled(place)
    recording = stranger(
        name="hand", kind="stranger_hand", library="library.so", plan={"host": host}, host=host
    )
    with pytest.raises(
        RecordingError, match="has participant 'hand' as engine, but kind 'stranger_hand' is one of a"
    ):
        verify(recording)
    assert left(place) == set()


@pytest.mark.parametrize(
    ("plan", "problem"),
    [
        ({"name": "other"}, "a participant has two names"),
        ({"role": "device"}, "its order is not that of its engines and controllers"),
    ],
)
def test_a_plan_that_contradicts_itself(stranger: Stranger, plan: dict[str, str], problem: str) -> None:
    with pytest.raises(RecordingError, match=f"its plan contradicts itself: {problem}"):
        verify(stranger(plan=plan), trust=True)


def test_to_read_a_recording_imports_nothing(stranger: Stranger, place: Path) -> None:
    recording = stranger(kind="foreign:Quiet", profile="paper")  # an old value, which the kind might accept
    assert recording.scenario().participants["one"].params["profile"] == "paper"
    assert "guest" in repr(recording)
    assert left(place) == set()


def test_the_command_line(
    stranger: Stranger, place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    recording = stranger(kind="foreign:Quiet")
    monkeypatch.setattr(sys, "argv", ["trocar", "verify", str(recording.file)])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    assert "the class 'foreign:Quiet'" in capfd.readouterr().err
    assert left(place) == set()


def test_nothing_in_a_recording_is_a_command_to_the_terminal(
    stranger: Stranger, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    recording = stranger(name="[/]\x1b]0;title\x07", kind="plant")
    monkeypatch.setattr(sys, "argv", ["trocar", "verify", str(recording.file)])
    with pytest.raises(SystemExit):
        main()
    err = capfd.readouterr().err
    assert "\x1b" not in err
    assert "title" in err
    show({"name": "[/]\x1b[2J"}, as_json=False)
    assert "[/]\\x1b[2J" in capfd.readouterr().out


@pytest.mark.parametrize(("command", "suffix"), [("report", ".html"), ("recover", "-recovered")])
def test_a_link_beside_a_recording_does_not_lead_the_output_elsewhere(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    command: str,
    suffix: str,
) -> None:
    write_session(tmp_path / "run", 0.01)
    (tmp_path / "empty").mkdir()
    (tmp_path / "secret").write_text("secret")
    (tmp_path / f"run{suffix}").symlink_to("secret" if command == "report" else "empty")
    monkeypatch.setattr(sys, "argv", ["trocar", command, str(tmp_path / "run")])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 1
    assert f"run{suffix}' is a link, through which nothing is written" in capfd.readouterr().err
    assert (tmp_path / "secret").read_text() == "secret"
    assert list((tmp_path / "empty").iterdir()) == []


def test_a_pipe_in_a_recording_is_not_waited_for(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    os.mkfifo(tmp_path / "run" / "run.mcap")
    with pytest.raises(RecordingError, match=r"holds 0 \.mcap files"):
        Recording(tmp_path / "run")
