"""Why a hub cannot be reached is said so that it can be mended."""

import re
import socket
import threading

import pytest

from hub.planning.plan import Plan
from hub.remote.hub_connection import connection_obstacle, reach
from hub.security import certs
from hub.security.access import access_settings
from hub.security.credentials import Credentials, load
from hub.security.gate import Gate
from hub.transport.zenoh_session import open_session
from schemas.errors import ConnectError
from tests.hub.authorities import Authority, free_endpoint, free_port

PLAN = Plan(step_ns=1, order=(), participants={}, connections=(), from_devices=(), to_devices=(), bonds=())


@pytest.fixture(scope="module")
def authority(tmp_path_factory):
    return Authority.founded(tmp_path_factory.mktemp("own"), "127.0.0.1")


@pytest.fixture(scope="module")
def stranger(tmp_path_factory):
    return Authority.founded(tmp_path_factory.mktemp("strange"), "127.0.0.1")


@pytest.fixture(scope="module")
def inside():
    endpoint = free_endpoint()
    with open_session("router", listen=[endpoint]):
        yield endpoint


@pytest.fixture(scope="module")
def port(authority, inside):
    """The port of a gate."""
    port = free_port()
    gate = Gate([f"tls/0.0.0.0:{port}"], authority.hub.listening() | access_settings(PLAN, "s"))
    gate.open(inside)
    yield port
    gate.close()


def test_nothing_is_in_the_way_of_a_good_certificate(authority, port):
    assert connection_obstacle("127.0.0.1", port, authority.issued("touch")) == ""
    with reach(f"tls/127.0.0.1:{port}", "touch", authority.directory) as session:
        assert list(session.info.routers_zid())


def test_a_server_that_is_no_hub_is_left_alone(authority, tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(certs, "HUB", "www.example")
        certs.renew(authority.directory, ["127.0.0.1"], 1)
    port = free_port()
    with (
        open_session(
            "router",
            listen=[f"tls/127.0.0.1:{port}"],
            security=load("www.example", authority.directory).listening(),
        ),
        pytest.raises(
            ConnectError,
            match=r"is no hub of the authority of .*touch\.pem: it presents the certificate of www\.example",
        ),
    ):
        reach(f"tls/127.0.0.1:{port}", "touch", authority.issued("touch").file)


def test_the_hub_has_another_name(authority, port):
    assert re.search(
        r"not for the name 'localhost'.*trocar certs renew",
        connection_obstacle("localhost", port, authority.issued("touch")),
    )


def test_the_hub_is_of_another_authority(stranger, port):
    assert re.search(
        r"of another authority than .*touch\.pem.*trocar certs issue touch",
        connection_obstacle("127.0.0.1", port, stranger.issued("touch")),
    )


def test_the_hub_does_not_accept_the_certificate(authority, stranger, port, tmp_path):
    foreign, file = stranger.issued("touch"), tmp_path / "touch.pem"
    mixed = Credentials(file, foreign.key, foreign.certificate, authority.hub.authority)
    file.write_text(mixed.key + mixed.certificate + mixed.authority)
    assert re.search(
        r"touch\.pem is of another authority than the hub's.*trocar certs issue touch",
        connection_obstacle("127.0.0.1", port, mixed),
    )
    expired = authority.issued("touch", days=-0.01)
    assert re.search(
        r"touch\.pem has expired.*trocar certs issue touch", connection_obstacle("127.0.0.1", port, expired)
    )
    authority.issued("touch")


def test_the_hubs_certificate_has_expired(inside, tmp_path):
    authority, port = Authority.founded(tmp_path, "127.0.0.1"), free_port()
    touch = authority.issued("touch")
    authority.renewed(-0.01)
    gate = Gate([f"tls/127.0.0.1:{port}"], authority.hub.listening() | access_settings(PLAN, "s"))
    gate.open(inside)
    try:
        assert re.search(
            r"its certificate has expired.*trocar certs renew", connection_obstacle("127.0.0.1", port, touch)
        )
    finally:
        gate.close()


def test_no_hub_is_there(authority):
    assert "no process listens there" in connection_obstacle(
        "127.0.0.1", free_port(), authority.issued("touch")
    )
    assert "this machine cannot resolve the name" in connection_obstacle(
        "no-such-hub.invalid", 7447, authority.issued("touch")
    )
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(60)

        def hang_up():
            connection, _ = server.accept()
            with connection:
                connection.recv(1000)
                connection.sendall(b"HTTP/1.0 400 Bad Request\r\n\r\n")

        thread = threading.Thread(target=hang_up)
        thread.start()
        assert "does not use TLS as a hub does" in connection_obstacle(
            "127.0.0.1", server.getsockname()[1], authority.issued("touch")
        )
        thread.join()


def test_a_hub_elsewhere_is_reached_by_tls_and_with_a_certificate_only(authority, tmp_path):
    with pytest.raises(ConnectError, match=r"reached by TLS only: tls/192\.0\.2\.1:7447"):
        reach("tcp/192.0.2.1:7447", "touch")
    with pytest.raises(ConnectError, match=r"there is no certificate .*touch\.pem"):
        reach("tls/192.0.2.1:7447", "touch", tmp_path)


def test_a_certificate_is_not_lent(authority):
    with pytest.raises(
        ConnectError, match=r"touch\.pem is the certificate of 'touch'; to join as 'head', use"
    ):
        reach("tls/127.0.0.1:7447", "head", authority.issued("touch").file)


def test_the_way_to_mend_it_comes_with_the_error(authority):
    with pytest.raises(
        ConnectError, match=r"cannot reach the hub at tls/127\.0\.0\.1:\d+: no process listens there"
    ):
        reach(f"tls/127.0.0.1:{free_port()}", "touch", authority.issued("touch").file)


def test_a_hub_of_this_machine_that_does_not_run_is_said_to_be_none():
    with pytest.raises(
        ConnectError,
        match=r"the hub at tcp/127\.0\.0\.1:\d+: no process listens there\. Is it running\? trocar ls",
    ):
        reach(f"tcp/127.0.0.1:{free_port()}", "touch")
