"""Mutated recordings through all that reads them: each is read, or raises a TrocarError.

They are files with spoilt bytes, sound files of messages, topics and attachments that are not, and files in
which a chunk unpacks to other bytes than stated, up to a gigabyte. `python -m tests.fuzz.recordings --number
500 --seed 7 --hours 1`; `--case 7:123` repeats one.
"""

from __future__ import annotations

import json
import lzma
import random
import shutil
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.records import Channel, Schema

from devices.ros.bags.export import export
from hub.recording.chunk import chunk_data
from hub.recording.mcap_file import McapFile
from hub.recording.recording import Recording
from hub.recording.recover import recover
from hub.recording.replay import replay
from hub.recording.report import report
from hub.transport.loopback_port import LoopbackPort
from hub.verify import verify
from schemas.errors import TrocarError
from schemas.vectors import has_vector
from tests.fuzz.byte_mutations import NUMBERS, WORDS, mutated, mutated_text
from tests.fuzz.chunk_mutations import Bombs, make_bombs, with_other_chunk
from tests.fuzz.harness import Note, Target, search
from tests.participants import make_participant
from webconsole.commands import Show
from webconsole.console import Console
from webconsole.frame import frame
from webconsole.new_sections import NewSections
from webconsole.pilot import Pilots
from webconsole.recorded import Recorded
from webconsole.stage import Stage

FOLDER = Path(__file__).parents[1] / "hub/recording/recordings_0_1_0"
NAMES = ["palpation", "ros", "ros-mirror", "table"]
_KEPT_NS = 20_000_000
"""Of each recording: enough for grants, acks, values and a status."""


class Contents:
    """The beginning of a recording, to be changed and written again."""

    def __init__(self, file: Path, until_ns: int = _KEPT_NS) -> None:
        with file.open("rb") as stream:
            reader = make_reader(stream)
            summary = reader.get_summary()
            assert summary is not None
            self.schemas = list(summary.schemas.values())
            self.channels = list(summary.channels.values())
            self.messages = [
                (channel.id, message.log_time, message.data)
                for _, channel, message in reader.iter_messages(ending_before=until_ns)
            ]
            self.attachments = [(one.name, one.data) for one in reader.iter_attachments()]

    def write(self, file: Path) -> None:
        """Write a sound file."""
        target = McapFile(file)
        try:
            for name, data in self.attachments:
                target.attach(name, data)
            schemas = {schema.id: schema for schema in self.schemas}
            for channel in self.channels:
                target.declare(schemas.get(channel.schema_id, self.schemas[0]), channel)
            for start in range(0, len(self.messages), 100):
                target.add_chunk(chunk_data(self.messages[start : start + 100]))
            target.finish()
        finally:
            target.close()


@cache
def _seed(name: str, directory: Path) -> Path:
    """Return the beginning of a recording, in a file."""
    whole, cut = directory / f"{name}-whole.mcap", directory / f"{name}.mcap"
    if not cut.exists():
        whole.write_bytes(lzma.decompress((FOLDER / f"{name}.mcap.xz").read_bytes()))
        Contents(whole).write(cut)
        whole.unlink()
    return cut


@cache
def _bombs() -> Bombs:
    """Compress zeros once, for all forked processes."""
    return make_bombs()


def _changed(contents: Contents, source: random.Random) -> str:
    """Change one thing, or several, and return what."""
    names: list[str] = []
    for _ in range(source.choice([1, 1, 2, 4])):
        change = source.choice(
            [_attachment, _attachment, _payload, _payload, _time, _channel, _schema, _order]
        )
        names.append(change.__name__.removeprefix("_"))
        change(contents, source)
    return "+".join(names)


def _attachment(contents: Contents, source: random.Random) -> None:
    at = source.randrange(len(contents.attachments))
    name, data = contents.attachments[at]
    if name.endswith(".json") and source.random() < 0.8:
        try:
            content: Any = json.loads(data)
        except ValueError:  # it was spoilt by a change before
            return
        for _ in range(source.choice([1, 1, 3])):
            content = _json(content, source)
        data = json.dumps(content).encode()
    elif source.random() < 0.8:
        data = mutated_text(data, source)[1]
    else:
        name = source.choice([*(other for other, _ in contents.attachments), "../x.json", "a" * 3000])
    contents.attachments[at] = name, data
    if source.random() < 0.1:
        del contents.attachments[source.randrange(len(contents.attachments))]


def _json(content: Any, source: random.Random) -> Any:
    """Replace, remove or repeat something somewhere in a tree."""
    if isinstance(content, dict | list) and content and source.random() < 0.9:
        keys = list(content) if isinstance(content, dict) else list(range(len(content)))
        key = source.choice(keys)
        match source.randrange(8):
            case 0:
                del content[key]
            case 1 if isinstance(content, list):
                content += [content[key]] * source.choice([1, 200])
            case 2 if isinstance(content, dict):
                content[source.choice(WORDS).decode("utf-8", "replace")[:3000]] = content[key]
            case _:
                content[key] = _json(content[key], source)
        return content
    word = source.choice(WORDS).decode("utf-8", "replace")[:5000]
    return source.choice(
        [None, True, [], {}, -1, 0, 1.5, 10**30, source.choice(NUMBERS), word, "robot", [content]]
    )


def _payload(contents: Contents, source: random.Random) -> None:
    for _ in range(source.choice([1, 20])):
        at = source.randrange(len(contents.messages))
        channel, time, data = contents.messages[at]
        others = [source.choice(contents.messages)[2]]
        contents.messages[at] = channel, time, mutated(data, source, others)[1]


def _time(contents: Contents, source: random.Random) -> None:
    at = source.randrange(len(contents.messages))
    channel, _, data = contents.messages[at]
    contents.messages[at] = channel, source.choice([*NUMBERS, 2**63 - 1]), data


def _channel(contents: Contents, source: random.Random) -> None:
    at, other = source.randrange(len(contents.channels)), source.choice(contents.channels)
    one = contents.channels[at]
    word = source.choice(WORDS).decode("utf-8", "replace")[:5000]
    topic = source.choice([one.topic, other.topic, word, f"{one.topic}/{word}", one.topic.replace("/", "//")])
    encoding = source.choice(["cdr", "cdr", "cdr", "json", ""])
    contents.channels[at] = Channel(one.id, topic, encoding, one.metadata, other.schema_id)


def _schema(contents: Contents, source: random.Random) -> None:
    at, other = source.randrange(len(contents.schemas)), source.choice(contents.schemas)
    one = contents.schemas[at]
    name = source.choice([other.name, source.choice(WORDS).decode("utf-8", "replace")[:5000], f"{one.name}x"])
    data = mutated_text(one.data, source)[1] if source.random() < 0.5 else one.data
    contents.schemas[at] = Schema(one.id, data, one.encoding, name)


def _order(contents: Contents, source: random.Random) -> None:
    """Repeat, remove or exchange messages, such as grants."""
    at, size = source.randrange(len(contents.messages) - 1), source.choice([1, 10, 1000])
    part = contents.messages[at : at + size]
    source.shuffle(part)
    contents.messages[at : at + size] = source.choice([[], part, part * 3])


def _read_all(file: Path, _directory: Path) -> None:
    """Read each port and each kind of message; what is not valid in one says nothing about another."""
    recording, error = Recording(file), None
    parts: list[Callable[[], object]] = [
        lambda: (repr(recording), recording._repr_html_(), recording.participants),
        lambda: (recording.versions(), recording.files(), recording.directory(), recording.started_ns()),
        lambda: (recording.session(), recording.plan()),
        lambda: list(recording.grants()),
        lambda: list(recording.statuses()),
        *(lambda name=name: list(recording.acks(name)) for name in recording.participants),
        *(lambda name=name: list(recording[name].messages()) for name in recording),
        *(
            lambda name=name: (recording[name].values, recording[name].columns)
            for name in recording
            if has_vector(recording.ports[name])
        ),
    ]
    for part in parts:
        try:
            part()
        except TrocarError as found:
            error = found
    if error is not None:
        raise error


def _recover(file: Path, directory: Path) -> None:
    Recording(recover(file, directory / "recovered").path)


def _replay(file: Path, _directory: Path) -> None:
    with LoopbackPort("tcp/127.0.0.1:0").listen() as session:
        replay(Recording(file), session, rate=0.0)


def _play(file: Path, directory: Path) -> None:
    """Play it as samples of a device."""
    _read_device("scripted", {"samples": str(file)}, directory)


def _play_ros(file: Path, directory: Path) -> None:
    """Play it as a bag of ROS."""
    params = {"bag": str(file), "arms": {"PSM1": {"instrument": "400006"}}, "listen": ["PSM1"]}
    _read_device("ros-bag", params, directory)


def _read_device(kind: str, params: dict[str, object], directory: Path) -> None:
    device = make_participant(kind, "played", params, directory)
    _ = device.ports
    device.open(directory)
    try:
        for t in range(0, _KEPT_NS, 5_000_000):
            device.read(t)
    finally:
        device.close()


def _verify(file: Path, _directory: Path) -> None:
    verify(Recording(file), endpoint="tcp/127.0.0.1:0")


def _show(file: Path, _directory: Path) -> None:
    """Show it on a page; once it is open, the page says what is damaged, and shows the rest."""
    source = Recorded(file)
    try:
        assert source.scenario is not None
        console = Console(source, Pilots())
        stage = Stage(source.scenario, source.outlets, source.params)
        show = Show(do="show", numbers=[*stage.numbers, *stage.gauges][:24])
        sections = NewSections(console)
        json.dumps(
            [stage.describe(), source.state, [one.as_json() for one in source.events]], allow_nan=False
        )
        for at_ns in (None, 0, _KEPT_NS // 2):
            frame(1, at_ns or 0, sections.make(stage, show, at_ns))
        assert stage.packed_geometry
    except TrocarError as error:
        raise AssertionError(f"the page of a recording ends: {error}") from error


ACTIONS: list[Callable[[Path, Path], None]] = [
    _read_all,
    _read_all,
    _show,
    _recover,
    _replay,
    _play,
    _play_ros,
    _verify,
    lambda file, directory: report(Recording(file), directory / "page.html"),
    lambda file, directory: export(Recording(file), directory / "bag") and None,
]
LABELS = ["read", "read", "show", "recover", "replay", "scripted", "ros-bag", "verify", "report", "export"]


def attempt(case: str, directory: Path, note: Note) -> None:
    """Do something with the recording of `case`, SEED:NUMBER."""
    source = random.Random(case)
    at = source.randrange(len(ACTIONS))
    name = "table" if LABELS[at] == "verify" else "ros" if LABELS[at] == "export" else source.choice(NAMES)
    place = directory / "mutated"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    file = place / "spoilt.mcap"
    way = source.random()
    if way < 0.4:
        label, data = mutated(_seed(name, directory).read_bytes(), source)
        file.write_bytes(data)
    elif way < 0.6:
        label, data = with_other_chunk(_seed(name, directory).read_bytes(), source, _bombs())
        file.write_bytes(data)
    else:
        contents = Contents(_seed(name, directory))
        label = _changed(contents, source)
        contents.write(file)
    note(f"{LABELS[at]} {name}: {label}")
    ACTIONS[at](file, place)


def prepare(directory: Path) -> None:
    """Cut the recordings, and import what reads them; nothing here opens a Zenoh session."""
    for name in NAMES:
        _read_all(_seed(name, directory), directory)
    _bombs()


def pristine(directory: Path) -> None:
    """Do everything with recordings as they are."""
    for action, label in zip(ACTIONS, LABELS, strict=True):
        place = directory / "pristine"
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        try:
            action(_seed("ros" if label == "export" else "table", directory), place)
        except TrocarError:
            if label in ("read", "verify", "export", "recover", "replay", "report"):
                raise


if __name__ == "__main__":
    sys.exit(search(Target(attempt, pristine, prepare), __doc__ or "", hours=0.25))
