"""What a master may answer, and what keeps a node from being known to it."""

import threading
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from devices.ros.ros1 import registration as ros1_registration
from devices.ros.ros1.registration import Entry, Registration
from devices.ros.ros1.xmlrpc_api import ApiResult, ApiServer, success
from tests.waiting import until

MADE_KNOWN = [[[1, "", []]], [[1, "", []]]]


@pytest.fixture(autouse=True)
def _often(monkeypatch):
    monkeypatch.setattr(ros1_registration, "_CHECK_S", 0.02)


def registers(uri):
    """Return a node that registers a publisher and a subscriber, and what it is told of publishers."""
    told = []
    registration = Registration(uri, "/node", "http://127.0.0.1:1/")
    registration.add(Entry("Publisher", "/a", ("std_msgs/String",)))
    registration.add(Entry("Subscriber", "/b", ("std_msgs/String",), lambda uris: told.append(sorted(uris))))
    return registration, told


@pytest.mark.parametrize(
    "answer",
    [
        [],
        [5, 5],
        [[1, "", []]] * 2,
        [{"faultCode": 1, "faultString": "no"}] * 2,
        [[[1, "", []]]] * 3,
        [[[1, "", []]], [[1, "", 5]]],
    ],
    ids=repr,
)
def test_an_answer_that_is_none_is_asked_for_again(answer, caplog):
    answers = iter([answer])
    calls = {
        "lookupNode": lambda *_: ApiResult(-1, "unknown", 0),
        "system.multicall": lambda *_: next(answers, MADE_KNOWN),
    }
    master = ApiServer("127.0.0.1", calls)
    registration, told = registers(master.uri)
    try:
        assert until(lambda: told), caplog.text
    finally:
        registration.close()
        master.close()
    assert caplog.text.count("waiting for the master") <= 1


@pytest.mark.parametrize("uri", ["rosrpc://127.0.0.1:5/", "nowhere", "http://[::1:5/"])
def test_a_node_of_its_name_at_an_address_that_is_none_is_no_other(uri):
    master = ApiServer(
        "127.0.0.1", {"lookupNode": lambda *_: success(uri), "system.multicall": lambda *_: MADE_KNOWN}
    )
    registration, told = registers(master.uri)
    try:
        assert until(lambda: told)
    finally:
        registration.close()
        master.close()


BODIES = [
    b"",
    b"<a/>",
    b"<?xml version='1.0' encoding='foo'?><a/>",
    *(
        f"<methodResponse>{part}</methodResponse>".encode()
        for part in (
            "<fault><value><int>1</int></value></fault>",
            "<params><param><value><int>x</int></value></param></params>",
        )
    ),
]


def test_something_else_at_the_masters_address_is_asked_again_and_again():
    asked = []

    class Other(BaseHTTPRequestHandler):
        def do_POST(self):
            self.rfile.read(int(self.headers["Content-Length"]))
            self.send_response(200)
            self.end_headers()
            self.wfile.write(BODIES[len(asked) % len(BODIES)])
            asked.append(self.path)

        def log_message(self, *_):
            pass

    with HTTPServer(("127.0.0.1", 0), Other) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.02,))
        thread.start()
        registration, _ = registers(f"http://127.0.0.1:{server.server_port}")
        try:
            assert until(lambda: len(asked) > 2 * len(BODIES)), asked
        finally:
            registration.close()
            server.shutdown()
            thread.join()
