"""Messages before the token of their publisher."""

import threading
from contextlib import closing

from devices.ros.zenoh import early_messages
from devices.ros.zenoh.early_messages import EarlyMessages
from devices.ros.zenoh.graph import Graph, gid_of, unidentified
from tests.devices.ros.zenoh.test_graph import COMMAND, ONE, STATE, entity, graph
from tests.waiting import until


class Heard:
    """The messages passed on, each with the name of its program, and whether the caller passed it on."""

    def __init__(self):
        self.messages = []

    def __call__(self, payload, sender):
        self.messages.append((payload, sender, threading.current_thread() is threading.main_thread()))


def test_a_message_of_a_known_program_is_passed_on_at_once():
    heard, token = Heard(), entity(ONE, COMMAND)
    with closing(EarlyMessages(graph(token))) as early:
        early.receive(COMMAND, gid_of(token), b"1", heard)
        assert heard.messages == [(b"1", "/console", True)]


def test_messages_wait_for_the_token_and_keep_their_order(monkeypatch):
    monkeypatch.setattr(early_messages, "_PATIENCE_S", 1e6)
    heard, token, it = Heard(), entity(ONE, COMMAND), graph(entity(ONE, STATE, number=2))
    with closing(EarlyMessages(it)) as early:
        for number in range(100):
            if number == 50:
                it.add(token)
                early.note_token()
            early.receive(COMMAND, gid_of(token), number, heard)
        assert until(lambda: len(heard.messages) == 100)
        assert [number for number, _, _ in heard.messages] == list(range(100))
        assert {name for _, name, _ in heard.messages} == {"/console"}
        assert not heard.messages[0][2], "it was held"


def test_a_publisher_without_a_token_waits_once(monkeypatch):
    monkeypatch.setattr(early_messages, "_PATIENCE_S", 0.05)
    heard, gid = Heard(), b"0" * 16
    with closing(EarlyMessages(Graph("own"))) as early:
        early.receive(COMMAND, gid, b"1", heard)
        assert until(lambda: heard.messages)
        assert until(lambda: not early._held)
        early.receive(COMMAND, gid, b"2", heard)
        assert heard.messages == [(b"1", unidentified(gid), False), (b"2", unidentified(gid), True)]


def test_the_last_message_of_a_program_that_has_left_does_not_wait(monkeypatch):
    monkeypatch.setattr(early_messages, "_PATIENCE_S", 1e6)
    heard, token = Heard(), entity(ONE, COMMAND)
    it = graph(token)
    it.remove(token)
    with closing(EarlyMessages(it)) as early:
        early.receive(COMMAND, gid_of(token), b"1", heard)
        assert heard.messages == [(b"1", unidentified(gid_of(token)), True)]


def test_messages_held_at_the_end_are_dropped(monkeypatch):
    monkeypatch.setattr(early_messages, "_PATIENCE_S", 1e6)
    heard = Heard()
    early = EarlyMessages(Graph("own"))
    early.receive(COMMAND, b"0" * 16, b"1", heard)
    early.close()
    assert heard.messages == []
