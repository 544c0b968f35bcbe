"""What the server tells a page of a recording, and what it refuses, without a browser."""

import asyncio
import json
import struct
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager, suppress
from weakref import WeakKeyDictionary

import numpy as np
import pytest
from mcap.records import Channel, Schema
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from schemas.codec import encode
from schemas.ros import Header, Time
from schemas.trocar_msgs import ScoreCard, ScoreValue
from tests.fuzz.recordings import Contents
from tests.webconsole.conftest import finish, served
from tests.webconsole.test_gate import Visitor
from webconsole.frame import SectionKind, sections
from webconsole.open_recording import open_recording
from webconsole.recorded import Recorded

LIMIT_S = 60.0
PASSED = WeakKeyDictionary()
"""Frames of each socket that came before an answer: `next_frame` returns these first."""


@asynccontextmanager
async def opened(server, role="operator"):
    visitor = Visitor(server).admit(role)
    given = {"Cookie": visitor.cookie, "Origin": f"http://{visitor.host}"}
    url = f"ws://{visitor.host}/page"
    async with connect(url, additional_headers=given, origin=None, open_timeout=LIMIT_S) as socket:
        yield socket


async def answer(socket, **wanted):
    """Return the next message with these values."""
    async with asyncio.timeout(LIMIT_S):
        async for message in socket:
            if isinstance(message, bytes):
                PASSED.setdefault(socket, []).append(message)
            elif wanted.items() <= (content := json.loads(message)).items():
                return content
    raise EOFError("the page was closed")


async def next_frame(socket):
    if passed := PASSED.get(socket):
        return sections(passed.pop(0))
    async with asyncio.timeout(LIMIT_S):
        async for message in socket:
            if isinstance(message, bytes):
                return sections(message)
    raise EOFError("the page was closed")


def run(test, server, **options):
    async def body():
        async with opened(server, **options) as socket:
            await answer(socket, **{"is": "session"})
            return await test(socket)

    return finish(body())


def test_a_page_learns_what_there_is(console_of_recording):
    async def body():
        async with opened(console_of_recording) as socket:
            return await answer(socket, **{"is": "session"}), await answer(socket, **{"is": "state"})

    session, state = finish(body())
    assert (session["kind"], session["role"]) == ("recording", "operator")
    assert {"robot.PSM1/probe/pose", "tissue.probe/wrench", "stylus.pose"} <= {
        one["name"] for one in session["numbers"]
    }
    assert session["notes"], "the scene of a robot without parameters cannot be made, and it says so"
    assert (state["session"], state["end"]) == ("palpation", 0.5)


def test_it_shows_any_instant_exactly(console_of_recording, recording):
    wrench = Recorded(recording).recording["tissue.probe/wrench"]

    async def body(socket):
        await socket.send('{"do": "show", "numbers": ["tissue.probe/wrench"]}')
        for time in (0.25, 0.1005, 0.4):
            await socket.send(json.dumps({"do": "at", "time": time}))
            number, time_ns, (section,) = await next_frame(socket)
            await socket.send(struct.pack("<I", number))
            if time_ns != round(time * 1e9):  # that of the end, which came before
                number, time_ns, (section,) = await next_frame(socket)
                await socket.send(struct.pack("<I", number))
            row = np.frombuffer(section.content)
            place = int(np.searchsorted(wrench.time, time, side="right")) - 1
            assert (section.kind, row[0]) == (SectionKind.SAMPLE, wrench.time[place])
            assert np.array_equal(row[1:], wrench.values[place])

    run(body, console_of_recording)


def test_a_page_that_does_not_acknowledge_gets_two_frames(console_of_recording):
    async def body(socket):
        await socket.send('{"do": "show", "numbers": ["tissue.probe/wrench"]}')
        for i in range(50):
            await socket.send(json.dumps({"do": "at", "time": 0.1 + 0.005 * i}))
            await asyncio.sleep(0.002)
        frames = [await next_frame(socket), await next_frame(socket)]
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.5):
                await next_frame(socket)
        await socket.send(struct.pack("<I", frames[-1][0]))
        _, time_ns, _ = await next_frame(socket)
        assert time_ns == 345_000_000, "then the newest, and none of those between"

    run(body, console_of_recording)


@pytest.mark.parametrize(
    ("sent", "why"),
    [
        ('{"do": "pause"}', "cannot be steered"),
        ('{"do": "lead", "device": "hand"}', "no device 'hand'"),
        ('{"do": "hand", "number": 1}', "leads no device"),
        ('{"do": "at", "time": NaN}', "not a command"),
        (b"abc", "3 bytes, expected 4"),
        (struct.pack("<I", 4_000_000), "the last one was"),
    ],
)
def test_what_cannot_be_done_is_refused_with_a_reason(console_of_recording, sent, why):
    async def body(socket):
        await socket.send(sent)
        while "error" not in (said := await answer(socket, **{"is": "answer"})):
            pass
        assert why in said["error"]

    run(body, console_of_recording)


def test_a_viewer_only_looks(console_of_recording):
    async def body(socket):
        await socket.send('{"do": "invite", "role": "operator"}')
        assert "a viewer may look" in (await answer(socket, **{"is": "answer"}))["error"]
        await socket.send('{"do": "at", "time": 0.2}')

    run(body, console_of_recording, role="viewer")


def test_a_page_that_sends_too_much_is_closed(console_of_recording):
    async def body(socket):
        for _ in range(250):
            await socket.send("{}")
        with suppress(ConnectionClosed):
            async for _ in socket:
                pass
        assert socket.close_code == 1008

    run(body, console_of_recording)


def test_a_seventeenth_page_is_refused(console_of_recording):
    async def body(_):
        async with AsyncExitStack() as stack:
            for _ in range(15):
                await stack.enter_async_context(opened(console_of_recording))
            with pytest.raises(InvalidStatus, match="403"):
                await stack.enter_async_context(opened(console_of_recording))

    run(body, console_of_recording)


def test_viewers_leave_pages_for_operators(console_of_recording):
    async def body(_):
        async with AsyncExitStack() as stack:
            for _ in range(12):
                await stack.enter_async_context(opened(console_of_recording, "viewer"))
            with pytest.raises(InvalidStatus, match="403"):
                await stack.enter_async_context(opened(console_of_recording, "viewer"))
            await stack.enter_async_context(opened(console_of_recording))

    run(body, console_of_recording)


def test_a_message_that_is_too_long_ends_the_connection(console_of_recording):
    async def body(socket):
        await socket.send("x" * 20_000)
        await socket.wait_closed()
        assert socket.close_code == 1009

    run(body, console_of_recording)


def test_damaged_messages_are_told_and_the_rest_is_shown(recording, tmp_path):
    """A status, a score card and a wrench that cannot be decoded, each beside sound ones."""
    (file,) = recording.glob("*.mcap")
    contents, damaged = Contents(file, 10**9), tmp_path / "damaged" / "damaged.mcap"
    damaged.parent.mkdir()
    names = {channel.topic: channel.id for channel in contents.channels}
    spoilt = {names["/hub/status"]: 0, names["/engine/tissue/out/probe/wrench"]: 300}
    contents.schemas.append(Schema(99, b"", "ros2msg", ScoreCard.ros_type))
    contents.channels.append(Channel(99, "/engine/task/out/card", "cdr", {}, 99))
    value = ScoreValue(name="path", value=1.5, unit="m", reason="")
    card = ScoreCard(header=Header(stamp=Time(), frame_id=""), task="t", goals=2, reached=1, metrics=[value])
    contents.messages += [(99, 100_000_000, encode(card)), (99, 400_000_000, b"\0\1\0\0\xff")]
    for channel, index in spoilt.items():
        at = [at for at, (of, *_) in enumerate(contents.messages) if of == channel][index]
        contents.messages[at] = (*contents.messages[at][:2], b"\0\1\0\0\xff\xff\xff")
    contents.write(damaged)

    async def body(socket):
        await socket.send('{"do": "show", "numbers": ["tissue.probe/wrench", "robot.PSM1/probe/pose"]}')
        told = [(await answer(socket, **{"is": "trouble"}))["text"] for _ in range(2)]  # those of the end
        await socket.send('{"do": "at", "time": 0.3015}')
        told.append((await answer(socket, **{"is": "trouble"}))["text"])
        causes = "1 statuses of the session cannot be read", "tissue.probe/wrench", "the score card"
        assert all(any(cause in text for text in told) for cause in causes), told
        await socket.send('{"do": "at", "time": 0.2}')
        while (state := await answer(socket, **{"is": "state"}))["card"] is None:
            pass
        assert (state["session"], state["state"]) == ("palpation", "recording")
        assert state["card"]["metrics"] == [{"name": "path", "value": 1.5, "unit": "m", "reason": ""}]
        frames = []
        while not frames or frames[-1][1] != 200_000_000:
            frames.append(await next_frame(socket))
            await socket.send(struct.pack("<I", frames[-1][0]))
        assert {section.place for section in frames[-1][2] if section.kind == SectionKind.SAMPLE} == {0, 1}

    with served(Recorded(damaged)) as server:
        run(body, server)
        events = json.loads(Visitor(server).admit().get("/events").body)
    assert [one for one in events if "not shown from here on" in one["text"]]
    assert [one for one in events if one["text"].startswith("contact")] == []


def test_a_recording_that_was_cut_short_is_shown_as_far_as_it_goes(recording, tmp_path, caplog):
    (file,) = recording.glob("*.mcap")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    with ExitStack() as stack:
        shown = open_recording(cut, stack)
        assert 0.1 < shown.state["end"] < 0.5
        assert "was cut short: it is shown up to" in caplog.text
        assert shown.newest("tissue.probe/wrench", None) is not None
