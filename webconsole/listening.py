"""Where the page's server listens: on loopback, and to further machines with the hub's certificate alone."""

from __future__ import annotations

import hashlib
import logging
import socket
import ssl
from collections.abc import Iterable
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

from hub.security.credentials import HUB, examine, load
from hub.transport.endpoints import address, is_loopback
from schemas.errors import ConnectError, ScenarioError

__all__ = ["Listening", "fingerprint", "on_loopback", "with_tls"]

log = logging.getLogger(__name__)

FIRST_PORT, _PORTS = 8470, 32
_HTTPS = 443


class Listening(NamedTuple):
    """A listening socket, and the addresses for browsers."""

    socket: socket.socket
    names: tuple[str, ...]
    """Names and addresses of this server, the best for a link first."""
    certificate: Path | None = None
    """With key and authority, of a server of TLS; None: without TLS, on loopback."""

    @property
    def port(self) -> int:
        """The TCP port."""
        return int(self.socket.getsockname()[1])

    @property
    def origins(self) -> tuple[str, ...]:
        """The origins of the page, as browsers state, in the order of `names`."""
        scheme = "http" if self.certificate is None else "https"
        port = "" if self.certificate and self.port == _HTTPS else f":{self.port}"
        return tuple(f"{scheme}://{_in_url(name)}{port}" for name in self.names)


def on_loopback(port: int | None = None) -> Listening:
    """Listen to this machine at `port`, by default at 8470 or the next free port.

    Raises ConnectError if no port is free.
    """
    tried = range(FIRST_PORT, FIRST_PORT + _PORTS) if port is None else (port,)
    listening = _first_free("127.0.0.1", tried)
    if port is None and listening.getsockname()[1] != FIRST_PORT:
        log.info("port %d is taken: the page is at %d", FIRST_PORT, listening.getsockname()[1])
    return Listening(listening, ("127.0.0.1", "localhost"))


def with_tls(endpoint: str, certificates: Path | None = None) -> Listening:
    """Listen at an endpoint such as tls/0.0.0.0:8470, with the hub's certificate.

    Args:
        endpoint: Where; browsers call the server by the names in the certificate.
        certificates: The hub's certificate or its directory; None: the directory of this user.

    Raises ScenarioError if the endpoint is not of TLS, ConnectError if the port is taken or the certificate
    is missing or not valid.
    """
    if not endpoint.startswith("tls/"):
        remedy = "leave --listen out, and give --port" if is_loopback(endpoint) else "write tls/HOST:PORT"
        raise ScenarioError(
            f"'{endpoint}' cannot be listened on: other machines reach the page by TLS only; {remedy}"
        )
    host, port = address(endpoint)
    credentials = load(HUB, certificates)
    names = [name.lower() for name in examine(credentials).hosts]  # as browsers write them
    if not names:
        raise ConnectError(f"{credentials.file} has no names: trocar certs renew HOST ...")
    names.sort(key=lambda name: (name != host, _within(name)))
    return Listening(_first_free(host, (port,)), tuple(names), credentials.file)


def fingerprint(certificate: Path) -> str:
    """Return the SHA-256 of the first certificate in a file, as browsers show it to a person."""
    text = certificate.read_text(encoding="ascii")
    pem = text[text.index("-----BEGIN CERTIFICATE-----") :].partition("-----END CERTIFICATE-----")
    digest = hashlib.sha256(ssl.PEM_cert_to_DER_cert(pem[0] + pem[1])).hexdigest()
    return ":".join(digest[i : i + 2] for i in range(0, len(digest), 2)).upper()


def _first_free(host: str, ports: Iterable[int]) -> socket.socket:
    problem = "none was tried"
    for number in ports:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        found = socket.socket(family)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            found.bind((host, number))
            found.listen()
        except OSError as error:
            found.close()
            problem = f"{host}:{number}: {error.strerror or error}"
            log.debug("%s", problem)
            continue
        return found
    raise ConnectError(f"the page finds no free port ({problem}); name another one")


def _within(name: str) -> bool:
    """Return whether a name or address is of this machine alone."""
    try:
        return ip_address(name).is_loopback
    except ValueError:
        return name == "localhost"


def _in_url(name: str) -> str:
    return f"[{name}]" if ":" in name else name
