import socket

import pytest

from hub import endpoint
from hub.endpoint import require_loopback
from schemas.errors import ConnectError, ScenarioError


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


@pytest.mark.parametrize("where", ["tcp/127.0.0.1:7447", "tcp/localhost:0", "tcp/[::1]:7447"])
def test_a_hub_may_listen_on_loopback(where: str) -> None:
    assert require_loopback(where) == where


@pytest.mark.parametrize("where", ["tcp/0.0.0.0:7447", "tcp/192.168.1.2:7447", "tcp/[::]:7447", "udp/127.0.0.1:7447", "tcp/hub:7447", "nonsense"])
def test_a_hub_does_not_listen_elsewhere(where: str) -> None:
    with pytest.raises(ScenarioError, match="loopback only"):
        require_loopback(where)
