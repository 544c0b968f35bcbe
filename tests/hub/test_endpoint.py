import socket

import pytest

from hub import endpoint
from schemas.errors import ConnectError


@pytest.fixture
def taken():
    """A port on which somebody listens."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        yield listener.getsockname()[1]


def test_a_taken_port_is_passed_over(taken):
    assert endpoint.free_endpoint([taken, 0]) != f"tcp/127.0.0.1:{taken}"


def test_no_free_port_is_an_error_that_says_what_to_do(taken):
    with pytest.raises(ConnectError, match="give --listen"):
        endpoint.free_endpoint([taken])


def test_listeners_are_found(taken, monkeypatch):
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        monkeypatch.setattr(endpoint, "PORTS", [taken, silent.getsockname()[1]])
        assert endpoint.listening_endpoints() == [f"tcp/127.0.0.1:{taken}"]
