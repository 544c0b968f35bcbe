"""Where pages are served: the next free port of loopback, and to other machines by TLS alone."""

import base64
import http.client
import json
import logging
import socket
import ssl

import pytest
from typer.testing import CliRunner

from hub.command_line.certs import app as certs
from schemas.errors import ConnectError, ScenarioError
from tests.waiting import until
from tests.webconsole.conftest import served
from tests.webconsole.recorded_scene import write_scene
from tests.webconsole.test_browser import Person
from tests.webconsole.test_gate import Visitor
from webconsole.command_line import app as view
from webconsole.listening import FIRST_PORT, fingerprint, on_loopback, with_tls
from webconsole.recorded import Recorded


def made_by_command(directory, *names):
    """Return a directory with the certificates of a hub of these names."""
    made = CliRunner().invoke(certs, ["init", *names, "--dir", str(directory)])
    assert made.exit_code == 0, made.output
    return directory


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    return made_by_command(tmp_path_factory.mktemp("certs") / "own", "localhost", "127.0.0.1", "Hub.Lab")


@pytest.fixture
def server(certificates, recording):
    with served(Recorded(recording), listening=with_tls("tls/0.0.0.0:0", certificates)) as server:
        yield server


@pytest.fixture
def visitor(server, certificates):
    return Visitor(server, ssl.create_default_context(cafile=certificates / "ca.pem"))


def test_the_next_free_port_is_taken_and_said(caplog):
    with caplog.at_level(logging.INFO), on_loopback().socket, on_loopback().socket:
        pass
    assert f"port {FIRST_PORT} is taken: the page is at" in caplog.text
    with on_loopback(0).socket as held, pytest.raises(ConnectError, match=r"finds no free port .*in use"):
        on_loopback(held.getsockname()[1])


def test_roles_get_in_by_their_links(visitor):
    for role in ("viewer", "operator"):
        answer = visitor.get(visitor.server.gate.invite(role))
        cookie = answer.headers["Set-Cookie"]
        assert cookie.startswith("__Host-trocar_")
        assert {"HttpOnly", "SameSite=strict", "Secure", "Path=/"} <= {*cookie.split("; ")}
        visitor.cookie = cookie.partition(";")[0]
        assert visitor.get().status == 200
        said = json.loads(visitor.page(Cookie=visitor.cookie, Origin=f"https://{visitor.host}"))
        assert said["role"] == role
    assert visitor.get(Host=f"hub.lab:{visitor.server.port}").status == 200


def test_others_get_nothing(visitor, caplog):
    port, own = visitor.server.port, f"https://{visitor.host}"
    assert visitor.admit().get().status == 200
    for headers in (
        {"Cookie": ""},
        {"Cookie": visitor.cookie[:-1]},
        {"Cookie": visitor.cookie.removeprefix("__Host-")},
        {"Host": f"evil.example:{port}"},
        {"Host": f"0.0.0.0:{port}"},
        {"Origin": f"http://{visitor.host}"},
        {"Origin": "https://evil.example"},
    ):
        assert visitor.get(**headers).status == 403, headers
    assert visitor.get("/?token=guessed", Cookie="").status == 403
    assert caplog.text.count("refused http") >= 5
    assert visitor.page(Origin=own) == 403
    assert visitor.page(Cookie=visitor.cookie, Origin=f"http://{visitor.host}") == 403
    assert visitor.page(Cookie=visitor.cookie, Origin="https://evil.example") == 403


def test_without_tls_or_with_another_authority_there_is_no_answer(visitor, tmp_path):
    plain = http.client.HTTPConnection("127.0.0.1", visitor.server.port, timeout=60)
    plain.request("GET", visitor.server.gate.invite("operator"))
    with pytest.raises((http.client.HTTPException, ConnectionError)):
        plain.getresponse()
    plain.close()
    other = made_by_command(tmp_path / "other", "127.0.0.1")
    with pytest.raises(ssl.SSLCertVerificationError):
        Visitor(visitor.server, ssl.create_default_context(cafile=other / "ca.pem")).get()


def connects(port):
    try:
        socket.create_connection(("127.0.0.1", port), timeout=60).close()
    except ConnectionRefusedError:
        return False
    return True


def test_it_ends_while_a_page_is_closing(certificates, recording):
    """The page has said that it closes, and its TLS is not yet closed."""
    listening = with_tls("tls/0.0.0.0:0", certificates)
    with served(Recorded(recording), listening=listening) as server:
        visitor = Visitor(server, ssl.create_default_context(cafile=certificates / "ca.pem")).admit()
        plain = socket.create_connection(("127.0.0.1", server.port), timeout=60)
        page = visitor.tls.wrap_socket(plain, server_hostname="127.0.0.1")
        head = {"Host": visitor.host, "Origin": f"https://{visitor.host}", "Cookie": visitor.cookie}
        head |= {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
        head["Sec-WebSocket-Key"] = base64.b64encode(bytes(16)).decode()
        lines = ["GET /page HTTP/1.1", *(f"{name}: {value}" for name, value in head.items()), "", ""]
        page.sendall("\r\n".join(lines).encode())
        assert page.recv(64).startswith(b"HTTP/1.1 101")
        page.sendall(bytes((0x88, 0x80, 0, 0, 0, 0)))  # a masked close frame
        while page.recv(4096):  # until the server has answered and closes
            pass
        server.stop()
        until(lambda: not connects(server.port))
        page.close()


@pytest.mark.parametrize(
    "endpoint", ["tcp/0.0.0.0:8470", "tcp/127.0.0.1:8470", "0.0.0.0:8470", "tls/0.0.0.0"]
)
def test_other_endpoints_are_rejected(certificates, endpoint):
    with pytest.raises(ScenarioError, match=r"cannot be listened on|is no endpoint"):
        with_tls(endpoint, certificates)


def test_without_a_certificate_it_says_how_to_get_one(tmp_path):
    with pytest.raises(ConnectError, match="trocar certs init"):
        with_tls("tls/0.0.0.0:0", tmp_path)
    both = CliRunner().invoke(view, ["--listen", "tls/0.0.0.0:8470", "--port", "8470"])
    assert isinstance(both.exception, ScenarioError)


def test_links_name_what_others_can_reach(certificates):
    with (listening := with_tls("tls/0.0.0.0:0", certificates)).socket:
        assert listening.names == ("hub.lab", "localhost", "127.0.0.1")
        assert listening.origins[0] == f"https://hub.lab:{listening.port}"
    with (chosen := with_tls("tls/127.0.0.1:0", certificates)).socket:
        assert chosen.names[0] == "127.0.0.1"


def test_a_browser_shows_the_page_by_tls(browser, certificates, tmp_path):
    """Its context is secure, without which there is no headset (WebXR)."""
    write_scene(tmp_path / "scene", 10)
    listening = with_tls("tls/0.0.0.0:0", certificates)
    with served(Recorded(tmp_path / "scene"), listening=listening) as server:
        link = f"https://127.0.0.1:{server.port}{server.gate.invite('viewer')}"
        one = Person(browser, link, ignore_https_errors=True)
        one.sees("isSecureContext && trocar.session?.role === 'viewer' && Boolean(trocar.scene?.placed)")
        assert one.errors == []
        shown = ssl.get_server_certificate(("127.0.0.1", server.port))
        one.context.close()
    file = tmp_path / "shown.pem"
    file.write_text(shown)
    assert fingerprint(file) == fingerprint(certificates / "hub.pem")
