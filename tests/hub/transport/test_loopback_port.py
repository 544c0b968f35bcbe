"""Hubs that start in the same moment listen at ports of their own."""

import socket
import threading

import pytest

from hub.transport.endpoints import PORTS, address, is_loopback
from hub.transport.loopback_port import LoopbackPort, listening_ports
from schemas.errors import ConnectError, ScenarioError


@pytest.fixture
def taken():
    """A port on which a process listens."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield listener.getsockname()[1]


def test_a_taken_port_is_skipped(taken):
    assert address(LoopbackPort(ports=[taken, 0]).endpoint)[1] not in (taken, 0)


def test_no_free_port_is_an_error_with_a_remedy(taken):
    with pytest.raises(ConnectError, match=f"no free port among {taken} to {taken}.*give --listen"):
        LoopbackPort(ports=[taken])


def test_a_port_that_is_chosen_is_held_until_the_hub_listens():
    port = LoopbackPort()
    with pytest.raises(OSError, match="in use"):
        socket.create_server(("127.0.0.1", address(port.endpoint)[1]))
    with port.listen() as session:
        assert not session.is_closed()


def test_twenty_hubs_that_start_at_once_listen_at_ports_of_their_own():
    start, endpoints, sessions = threading.Barrier(len(PORTS)), [], []

    def listen():
        start.wait()
        port = LoopbackPort("tcp/127.0.0.1:0")
        sessions.append(port.listen())
        endpoints.append(port.endpoint)

    threads = [threading.Thread(target=listen) for _ in PORTS]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for session in sessions:
        session.close()
    assert len(set(endpoints)) == len(PORTS)


def test_another_port_is_chosen_when_one_is_taken_at_the_last_moment(monkeypatch):
    port = LoopbackPort("tcp/127.0.0.1:0")
    first, release = port.endpoint, port.release
    thief = socket.socket()

    def stolen():
        release()
        monkeypatch.setattr(port, "release", release)
        thief.bind(("127.0.0.1", address(first)[1]))
        thief.listen()

    monkeypatch.setattr(port, "release", stolen)
    with thief, port.listen():
        assert port.endpoint != first


def test_a_port_that_is_given_and_taken_is_an_error(taken):
    with pytest.raises(ConnectError, match=f"cannot listen on tcp/127.0.0.1:{taken}"):
        LoopbackPort(f"tcp/127.0.0.1:{taken}").listen()


def test_the_hub_stays_on_loopback_beside_its_gate():
    inside, outside = listening_ports(["tls/0.0.0.0:7447"])
    inside.release()
    assert outside == ["tls/0.0.0.0:7447"]
    assert is_loopback(inside.endpoint)
    assert address(inside.endpoint)[1] != 7447
    inside, outside = listening_ports(["tcp/127.0.0.1:5", "tls/0.0.0.0:6", "tls/[::]:6"])
    assert (inside.endpoint, outside) == ("tcp/127.0.0.1:5", ["tls/0.0.0.0:6", "tls/[::]:6"])
    with pytest.raises(ScenarioError, match="once on loopback"):
        listening_ports(["tcp/127.0.0.1:5", "tcp/127.0.0.1:6"])
