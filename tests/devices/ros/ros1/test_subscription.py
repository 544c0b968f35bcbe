"""Links of a ROS 1 node to those that publish, without a master and without ROS: which messages count as kept
from before, and programs that go wrong.
"""

import socket
import threading
from contextlib import contextmanager
from queue import Queue

import pytest

from devices.ros.ros1 import subscription as ros1_subscription
from devices.ros.ros1.transport import Ros1Transport
from devices.ros.ros1.xmlrpc_api import ApiResult, ApiServer, success
from devices.ros.topics.row import Row
from schemas.codec import encode
from schemas.ros import StringMessage
from tests.hub.authorities import free_port
from tests.waiting import until

TOPIC, WORD = "/PSM1/set_tool_type", StringMessage.ros_type
LATCHED, HEARD = Row(TOPIC, WORD, "publish", latched=True), Row(TOPIC, WORD, "subscribe")


@contextmanager
def node(name):
    transport = Ros1Transport(f"http://127.0.0.1:{free_port()}", name, "127.0.0.1")
    try:
        yield transport
    finally:
        transport.close()


@pytest.fixture
def listening(monkeypatch):
    """A node that listens, and a queue of when its senders were connected (0: what they say is meant now)."""
    monkeypatch.setattr(ros1_subscription, "_FIRST_RETRY_S", 0.05)
    with node("/listener") as listener:
        connected = Queue()
        listener.subscribe(HEARD, lambda payload, client, /, *, connected_ns=0: connected.put(connected_ns))
        yield listener, connected


@pytest.fixture
def publisher():
    with node("/publisher") as it:
        yield it


def say(publisher):
    publisher.advertise(LATCHED)(encode(StringMessage(data="400006")))


def is_told_of(listener, *uris, by_answer=False):
    listener._subscriptions.update(TOPIC, uris, published_before=by_answer)


def test_one_that_comes_later_means_what_it_has_kept(listening, publisher):
    listener, connected = listening
    is_told_of(listener, by_answer=True)
    say(publisher)
    is_told_of(listener, publisher._server.uri)
    assert connected.get(timeout=60.0) == 0


@pytest.mark.parametrize("by_answer", [True, False])
def test_one_that_may_have_been_there_before_does_not(listening, publisher, by_answer):
    listener, connected = listening
    say(publisher)
    # False: another one has made itself known while we did
    is_told_of(listener, publisher._server.uri, by_answer=by_answer)
    is_told_of(listener, publisher._server.uri, by_answer=not by_answer)
    assert connected.get(timeout=60.0) > 0


def test_one_that_was_not_reached_at_first_does_not(listening, publisher):
    listener, connected = listening
    is_told_of(listener, by_answer=True)
    is_told_of(listener, publisher._server.uri)  # and does not publish it yet
    assert until(
        lambda: any(
            link.delay for links in listener._subscriptions._links.values() for link in links.values()
        )
    )
    say(publisher)
    assert connected.get(timeout=60.0) > 0


NOWHERE = [
    ["TCPROS", "127.0.0.1"],
    ["TCPROS", "127.0.0.1", 70000],
    ["TCPROS", 5, 5],
    ["TCPROS", "a" * 300, 5],
    0,
]


@pytest.mark.parametrize(
    "answer", [*(success(place) for place in NOWHERE), ApiResult(0, "", 0), "none"], ids=repr
)
def test_one_that_names_no_place_is_asked_again(listening, answer):
    listener, _ = listening
    with socket.create_server(("127.0.0.1", 0)) as server:
        answers = iter([answer])
        program = ApiServer(
            "127.0.0.1",
            {"requestTopic": lambda *_: next(answers, success(["TCPROS", *server.getsockname()]))},
        )
        try:
            is_told_of(listener, program.uri)
            server.settimeout(60.0)
            server.accept()[0].close()
        finally:
            program.close()


@pytest.mark.parametrize("uri", ["rosrpc://127.0.0.1:5/", "http://[::1:5/", "", "nowhere"])
def test_an_address_that_is_none_leaves_no_thread(listening, uri):
    listener, _ = listening
    is_told_of(listener, uri)
    assert until(lambda: any(link.delay for link in listener._subscriptions._links[uri].values())), (
        "it is tried again"
    )
    is_told_of(listener)
    assert until(lambda: uri not in listener._subscriptions._links)
    assert until(lambda: not any(thread.name == f"ROS 1 {uri}" for thread in threading.enumerate()))


@pytest.mark.parametrize("answer", ["nothing", ApiResult(0, "shutting down", 0)], ids=repr)
def test_a_program_that_ends_while_we_connect_is_no_wrong_address(listening, caplog, answer):
    """It closes the connection without an answer, or answers that it publishes the topic no more."""
    listener, _ = listening
    attempts = []
    if answer == "nothing":
        with socket.create_server(("127.0.0.1", 0)) as server:
            is_told_of(listener, f"http://127.0.0.1:{server.getsockname()[1]}/")
            server.settimeout(60.0)
            for _ in range(4):  # each attempt connects a second time where the first is closed
                server.accept()[0].close()
    else:
        program = ApiServer("127.0.0.1", {"requestTopic": lambda *_: attempts.append(1) or answer})
        is_told_of(listener, program.uri)
        try:
            assert until(lambda: len(attempts) >= 3)
        finally:
            program.close()
    assert "cannot be reached" not in caplog.text


def test_an_address_that_leads_nowhere_is_logged_once_it_lasts(listening, caplog):
    listener, _ = listening
    is_told_of(listener, "http://nowhere.invalid:1/")
    assert until(lambda: "Its ROS_IP or ROS_HOSTNAME must be an address" in caplog.text)
    assert until(
        lambda: all(
            link.delay > 0.1 for links in listener._subscriptions._links.values() for link in links.values()
        )
    )
    assert caplog.text.count("cannot be reached") == 1


def test_a_failure_nobody_thought_of_is_not_made_again_with_the_same_bytes(listening, publisher, caplog):
    listener, _ = listening
    taken = []

    def fail(payload, client, /, *, connected_ns=0):
        taken.append(payload)
        raise RuntimeError("unthought of")

    listener.subscribe(HEARD, fail)
    say(publisher)
    is_told_of(listener, publisher._server.uri)
    assert until(lambda: len(taken) == 2), "connected again, and told the last message again"
    assert until(lambda: caplog.text.count("RuntimeError: unthought of") == 2), "logged after it is raised"
