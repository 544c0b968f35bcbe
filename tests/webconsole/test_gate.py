"""Who gets in: each attempt over a real socket."""

import http.client
import logging
import re

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus

from tests.webconsole.conftest import finish, served
from webconsole.recorded import Recorded


class Visitor:
    """Sends requests with any head; `tls`: the context of a client, None: without TLS."""

    def __init__(self, server, tls=None):
        self.server, self.host, self.cookie, self.tls = server, f"127.0.0.1:{server.port}", "", tls

    def get(self, path="/", method="GET", **headers):
        place = {"host": "127.0.0.1", "port": self.server.port, "timeout": 10}
        connection = (
            http.client.HTTPConnection(**place)
            if self.tls is None
            else http.client.HTTPSConnection(**place, context=self.tls)
        )
        connection.putrequest(method, path, skip_host=True)
        for name, value in {"Host": self.host, "Cookie": self.cookie, **headers}.items():
            if value:
                connection.putheader(name, value)
        connection.endheaders()
        answer = connection.getresponse()
        answer.body = answer.read()
        connection.close()
        return answer

    def admit(self, role="operator"):
        answer = self.get(self.server.gate.invite(role))
        assert (answer.status, answer.headers["Location"]) == (303, "/")
        assert {"HttpOnly", "SameSite=strict"} <= {*re.split("; ", answer.headers["Set-Cookie"])}
        self.cookie = answer.headers["Set-Cookie"].partition(";")[0]
        return self

    def page(self, **headers):
        """Return the first message of a page, or the status of a refusal."""

        async def first():
            try:
                async with connect(
                    f"{'wss' if self.tls else 'ws'}://127.0.0.1:{self.server.port}/page",
                    additional_headers=headers,
                    origin=None,
                    ssl=self.tls,
                ) as socket:
                    return await socket.recv()
            except InvalidStatus as refused:
                return refused.response.status_code

        return finish(first())


@pytest.fixture
def visitor(recording):
    with served(Recorded(recording)) as server:  # the log of one has a limit
        yield Visitor(server)


def test_a_link_opens_the_page_once(visitor):
    link = visitor.server.gate.invite("operator")
    assert visitor.get(link).status == 303
    assert visitor.get(link).status == 403


def test_a_look_ahead_does_not_use_up_the_link(visitor):
    link = visitor.server.gate.invite("operator")
    assert visitor.get(link, method="HEAD").status == 403
    assert visitor.get(link).status == 303


def test_viewers_do_not_take_the_places_of_operators(visitor):
    gate = visitor.server.gate
    assert {visitor.get(gate.invite("viewer")).status for _ in range(64)} == {303}
    refused = visitor.get(gate.invite("viewer"))
    assert (refused.status, b"64 browsers are let in as viewers" in refused.body) == (403, True)
    assert visitor.admit().get().status == 200


def test_a_long_head_is_refused_before_its_cookies_are_read(visitor):
    """Python's `http.cookies` takes 8 s for such a cookie, and the event loop waits for it."""
    long = f'{visitor.admit().cookie}; other="' + "\\377" * 15_000
    assert visitor.get(Cookie=long).status in (400, 431), "by HTTP's parser, or by the gate"
    refused = visitor.get(Cookie=long[:4200])
    assert (refused.status, b"at most 4096 are allowed" in refused.body) == (431, True)
    assert visitor.page(Cookie=long[:4200], Origin=f"http://{visitor.host}") in (400, 403)
    assert visitor.get(Cookie=f"other=1; a;; ={'x' * 99}; {visitor.cookie}").status == 200


def test_who_is_in_may_use_the_old_link(visitor):
    link = visitor.server.gate.invite("operator")
    visitor.cookie = visitor.get(link).headers["Set-Cookie"].partition(";")[0]
    assert visitor.get(link).status == 303


def test_the_page_allows_nothing_from_elsewhere(visitor):
    answer = visitor.admit().get()
    assert answer.status == 200
    policy = answer.headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy
    assert answer.headers["X-Content-Type-Options"] == "nosniff"


@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/", {"Cookie": "none=1"}),
        ("/", {"Cookie": "trocar_0=x"}),
        ("/web/main.js", {"Cookie": "none=1"}),
        ("/scene", {"Cookie": "none=1"}),
        ("/?token=guessed", {"Cookie": "none=1"}),
        ("/", {"Host": "evil.example"}),
        ("/", {"Host": "127.0.0.1"}),
        ("/", {"Origin": "https://evil.example"}),
        ("/", {"Origin": "null"}),
    ],
)
def test_others_get_nothing_and_are_logged(visitor, caplog, path, headers):
    with caplog.at_level(logging.WARNING, "webconsole.gate"):
        answer = visitor.admit().get(path, **headers)
    assert answer.status == 403
    assert b"<html" not in answer.body
    assert "refused http" in caplog.text


def test_only_looking_is_a_method(visitor):
    assert visitor.admit().get("/", method="POST").status == 403


def test_files_of_the_disk_are_not_served(visitor):
    visitor.admit()
    for path in (
        "/web/../server.py",
        "/web/%2e%2e/server.py",
        "/web/vendor/../../server.py",
        "/web//etc/passwd",
    ):
        assert visitor.get(path).status in (403, 404)


def test_a_socket_needs_cookie_and_origin(visitor):
    visitor.admit()
    own = f"http://{visitor.host}"
    assert '"is":' in visitor.page(Cookie=visitor.cookie, Origin=own)
    assert visitor.page(Origin=own) == 403
    assert visitor.page(Cookie=visitor.cookie) == 403
    assert visitor.page(Cookie=visitor.cookie, Origin="https://evil.example") == 403
    assert visitor.page(Cookie=visitor.cookie, Origin=f"http://127.0.0.1:{visitor.server.port + 1}") == 403
