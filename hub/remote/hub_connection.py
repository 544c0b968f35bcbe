"""Connecting to a hub, on this machine or another, and finding the cause of a failure."""

from __future__ import annotations

import socket
import ssl
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import zenoh

from hub.security.credentials import HUB, Credentials, examine, load
from hub.transport.endpoints import address, is_loopback
from hub.transport.session_secret import secret_of
from hub.transport.zenoh_session import open_session
from schemas.errors import ConnectError

__all__ = ["connection_obstacle", "is_listening", "reach"]

_TIMEOUT_S = 3.0
_STARTING_S = 5.0
_PUBLISHING_S = 0.2
"""A listening hub publishes the secret within milliseconds."""
_POLL_S = 0.05

_VERDICTS = {
    "UNKNOWN_CA": "is of another authority than the hub's",
    "CERTIFICATE_EXPIRED": "has expired, by the clock of the hub's machine",
    "BAD_CERTIFICATE": "is not valid, by the clock of the hub's machine",
}
"""Why a hub rejects a certificate, by OpenSSL's name of the alert."""


def reach(
    endpoint: str, name: str, certificates: Path | None = None, *, mode: str = "client"
) -> zenoh.Session:
    """Open a Zenoh session with the hub at `endpoint`.

    The secret of the session is needed on the hub's machine, the certificate of `name` on any other.

    `mode` is Zenoh's, and used on loopback only: from other machines everything goes through the hub. Raises
    ConnectError with the remedy.
    """
    host, port = address(endpoint)
    if is_loopback(endpoint):
        try:
            return open_session(
                mode,
                listen=["tcp/127.0.0.1:0"] if mode == "peer" else [],
                connect=[endpoint],
                security=_find_secret(endpoint),
            )
        except ConnectError as error:
            if is_listening(endpoint):
                raise
            raise ConnectError(
                f"cannot reach the hub at {endpoint}: no process listens there. Is it running? trocar ls"
                " shows the sessions of this machine"
            ) from error
    if not endpoint.startswith("tls/"):
        raise ConnectError(
            f"'{endpoint}': a hub on another machine is reached by TLS only: tls/{host}:{port}"
        )
    credentials = load(name, certificates)
    holder = examine(credentials).name
    if holder != name:
        raise ConnectError(
            f"{credentials.file} is the certificate of '{holder}'; to join as '{name}', use that of '{name}'"
        )
    try:
        session = open_session("client", connect=[endpoint], security=credentials.connecting())
    except ConnectError as error:
        raise ConnectError(
            f"cannot reach the hub at {endpoint}: {connection_obstacle(host, port, credentials) or error}"
        ) from error
    names = {link.auth_identifier for link in session.info.links()}
    # Zenoh also trusts the authorities of the web, which issue no certificates for names without a domain
    if names - {HUB}:
        session.close()
        raise ConnectError(
            f"the server at {endpoint} is no hub of the authority of {credentials.file}: it presents the"
            f" certificate of {', '.join(map(str, names))}"
        )
    return session


def _find_secret(endpoint: str) -> dict[str, Any]:
    """Return the secret of the session at `endpoint`; its hub may be about to start, or to publish it."""
    deadline = monotonic() + _STARTING_S
    while True:
        try:
            return secret_of(endpoint)
        except ConnectError:
            if monotonic() > deadline:
                raise
            if is_listening(endpoint):
                deadline = min(deadline, monotonic() + _PUBLISHING_S)
            sleep(_POLL_S)


def connection_obstacle(host: str, port: int, credentials: Credentials) -> str:
    """Return why a connection fails, or an empty string; Python's TLS gives the reason, unlike Zenoh."""
    context = ssl.create_default_context(cadata=credentials.authority)
    context.load_cert_chain(credentials.file)
    try:
        with (
            socket.create_connection((host, port), _TIMEOUT_S) as plain,
            context.wrap_socket(plain, server_hostname=host) as secure,
        ):
            secure.recv(1)  # in TLS 1.3 the verdict on our certificate follows the handshake
    except ssl.SSLCertVerificationError as error:
        return _problem_of_hub(host, error, credentials)
    except ssl.SSLError as error:
        reason = error.reason or str(error)
        verdict = next((words for alert, words in _VERDICTS.items() if alert in reason), "")
        if verdict:
            return (
                f"the certificate {credentials.file} {verdict}. On the hub's machine: trocar certs issue"
                f" {credentials.name}; then copy it here again"
            )
        return (
            f"the server there does not use TLS as a hub does ({reason}); start the hub with --listen"
            f" tls/0.0.0.0:{port}"
        )
    except socket.gaierror:
        return f"this machine cannot resolve the name '{host}'; give the address instead"
    except ConnectionRefusedError:
        return f"no process listens there. Is the hub running, with --listen tls/0.0.0.0:{port}?"
    except TimeoutError:
        if _accepts_connection(host, port):
            return ""
        return (
            "no answer. Is the address right, and does the firewall of the hub's machine allow TCP port"
            f" {port}?"
        )
    except OSError as error:
        return f"{error}"
    return ""


def _problem_of_hub(host: str, error: ssl.SSLCertVerificationError, credentials: Credentials) -> str:
    if "expired" in error.verify_message:
        return "its certificate has expired. On its machine: trocar certs renew"
    if "match" in error.verify_message:
        return (
            f"its certificate is not for the name '{host}'. On its machine, trocar certs show lists the"
            " names; to change them: trocar certs renew NAME ..."
        )
    return (
        f"its certificate is of another authority than {credentials.file} ({error.verify_message}). On the"
        f" hub's machine: trocar certs issue {credentials.name}; then copy it here again"
    )


def is_listening(endpoint: str) -> bool:
    """Return whether a process listens at `endpoint`."""
    return _accepts_connection(*address(endpoint))


def _accepts_connection(host: str, port: int) -> bool:
    try:
        with socket.create_connection((host, port), _TIMEOUT_S):
            return True
    except OSError:
        return False
