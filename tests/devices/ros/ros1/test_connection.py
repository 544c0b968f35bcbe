"""Connections of ROS 1: headers, frames in pieces, readers that do not keep up, and what is no header or no
message.
"""

import queue
import socket
import struct
from contextlib import contextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.ros.ros1.connection import Connection, header_frame, parse_header
from devices.ros.ros1.event_loop import EventLoop
from schemas.errors import MessageError

NAMES = st.text(st.characters(codec="utf-8", exclude_characters="="), min_size=1)


def framed(content):
    return struct.pack("<I", len(content)) + content


@contextmanager
def connected(keep=3, greet=None):
    """A connection, its other end, and queues of what it has heard and of whether it was lost."""
    loop, heard, ends = EventLoop("test"), queue.Queue(), queue.Queue()

    def on_header(connection, fields):
        heard.put(fields)
        return heard.put if greet is None else greet(connection, fields)

    with socket.create_server(("127.0.0.1", 0)) as server:
        other = socket.create_connection(server.getsockname(), timeout=60.0)
        sock, _ = server.accept()
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    connection = Connection(loop, sock, on_header, ends.put, keep=keep)
    connection.start()
    try:
        yield connection, other, heard, ends
    finally:
        other.close()
        loop.close()


def received(sock, count):
    data = bytearray()
    while len(data) < count:
        chunk = sock.recv(count - len(data))
        assert chunk, "closed"
        data += chunk
    return bytes(data)


@given(st.dictionaries(NAMES, st.text(st.characters(codec="utf-8"))))
def test_a_header_says_what_was_put_into_it(fields):
    assert parse_header(header_frame(fields)[4:]) == fields


def test_frames_come_whole_however_they_are_cut():
    data = (
        header_frame({"callerid": "/it", "topic": "/a"}) + framed(b"one") + framed(b"") + framed(b"x" * 70000)
    )
    with connected() as (connection, other, heard, _):
        assert (connection.program, connection.is_established) == ("127.0.0.1", False)
        for at in range(150):
            other.send(data[at : at + 1])
        other.sendall(data[150:])
        assert heard.get(timeout=60.0) == {"callerid": "/it", "topic": "/a"}
        assert [heard.get(timeout=60.0) for _ in range(3)] == [b"one", b"", b"x" * 70000]
        assert (connection.program, connection.is_established) == ("/it", True)


@pytest.mark.parametrize(
    "data",
    [
        b"\xff\xff\xff\x7f",
        framed(b"\x05\x00\x00\x00a=b"),
        framed(b"\x03\x00\x00\x00abc"),
        framed(b"\x02\x00\x00\x00\xff="),
    ],
)
def test_what_is_no_header_is_hung_up_on(data, caplog):
    with connected() as (_, other, heard, ends):
        other.sendall(data)
        assert ends.get(timeout=60.0)
        assert heard.empty()
        assert "is closed" in caplog.text


def test_a_field_of_any_length_is_quoted_in_part():
    with pytest.raises(MessageError, match="has no value or no end") as caught:
        parse_header(framed(b"a" * 30_000))
    assert len(str(caught.value)) < 200


def test_a_message_that_is_too_large_is_hung_up_on(caplog):
    with connected() as (_, other, _heard, ends):
        other.sendall(header_frame({"topic": "/a"}) + struct.pack("<I", 1 << 30))
        assert ends.get(timeout=60.0)
        assert "exceed the limit" in caplog.text


def test_a_failure_nobody_thought_of_ends_no_other_connection(caplog):
    def greet(connection, fields):
        raise RuntimeError("unthought of")

    with connected(greet=greet) as (connection, other, _, ends):
        other.sendall(header_frame({"topic": "/a"}))
        assert ends.get(timeout=60.0) is connection, "it is closed: the same bytes would make it fail again"
        called = queue.Queue()
        connection._loop.call(lambda: called.put(True))
        assert called.get(timeout=60.0)
        assert "unthought of" in caplog.text


def test_who_does_not_keep_up_gets_the_newest_and_whole_messages():
    messages = [framed(bytes([number]) * 1_000_000) for number in range(40)]
    with connected(keep=3) as (connection, other, _, _):
        for message in messages:  # the reader is this thread: if sending waited for it, it would never end
            connection.send(message)
        numbers = []
        while not numbers or numbers[-1] != 39:
            (length,) = struct.unpack("<I", received(other, 4))
            content = received(other, length)
            assert content == content[:1] * 1_000_000
            numbers.append(content[0])
        assert numbers == sorted(numbers)
        assert numbers[-3:] == [37, 38, 39]
        assert len(numbers) < 40
        connection.send(framed(b"again"))
        assert received(other, 9) == framed(b"again")


def test_who_goes_is_told_once_and_sending_goes_on():
    with connected() as (connection, other, _, ends):
        other.close()
        assert ends.get(timeout=60.0) is connection
        connection.send(framed(b"into the void"))
        assert ends.empty()


def test_a_machine_that_goes_off_without_a_word_is_asked_for():
    with connected() as (connection, _, _, _):
        assert connection._socket.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
