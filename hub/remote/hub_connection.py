"""Reaching a hub, on this machine or another one, and finding out why it cannot be reached."""

from __future__ import annotations

import socket
import ssl
from pathlib import Path

import zenoh

from hub.security.credentials import HUB, Credentials, examine, load
from hub.transport.endpoints import address, is_loopback
from hub.transport.zenoh_session import open_session
from schemas.errors import ConnectError

__all__ = ["obstacle", "reach"]

_PATIENCE_S = 3.0

_VERDICTS = {
    "UNKNOWN_CA": "is of another authority than the hub's",
    "CERTIFICATE_EXPIRED": "has expired, by the clock of the hub's machine",
    "BAD_CERTIFICATE": "is not valid, by the clock of the hub's machine",
}
"""What a hub says of a certificate that it does not accept, by what OpenSSL calls the alert."""


def reach(
    endpoint: str, name: str, certificates: Path | None = None, *, mode: str = "client"
) -> zenoh.Session:
    """Open a Zenoh session with the hub at `endpoint`: over loopback as it is, from another machine with the
    certificate of `name`.

    `mode`, Zenoh's, counts over loopback only: from elsewhere everything goes through the hub. Raises
    ConnectError with what mends it.
    """
    host, port = address(endpoint)
    if is_loopback(endpoint):
        try:
            return open_session(
                mode, listen=["tcp/127.0.0.1:0"] if mode == "peer" else [], connect=[endpoint]
            )
        except ConnectError as error:
            if _answers(host, port):
                raise
            raise ConnectError(
                f"cannot reach the hub at {endpoint}: nobody listens there. Is it running? trocar ls shows"
                " the sessions of this machine"
            ) from error
    if not endpoint.startswith("tls/"):
        raise ConnectError(
            f"'{endpoint}': a hub on another machine is reached by TLS only: tls/{host}:{port}"
        )
    credentials = load(name, certificates)
    whose = examine(credentials).name
    if whose != name:
        raise ConnectError(
            f"{credentials.file} is the certificate of '{whose}', with which nobody can join as '{name}'"
        )
    try:
        session = open_session("client", connect=[endpoint], security=credentials.connecting())
    except ConnectError as error:
        raise ConnectError(
            f"cannot reach the hub at {endpoint}: {obstacle(host, port, credentials) or error}"
        ) from error
    names = {link.auth_identifier for link in session.info.links()}
    # Zenoh also trusts the authorities of the web, none of which vouches for a name without a domain
    if names - {HUB}:
        session.close()
        raise ConnectError(
            f"who answers at {endpoint} is no hub of the authority of {credentials.file}: it shows that of"
            f" {', '.join(map(str, names))}"
        )
    return session


def obstacle(host: str, port: int, credentials: Credentials) -> str:
    """Go the same way once more with Python's own TLS, which says what Zenoh does not; return what is in the
    way, if anything.
    """
    context = ssl.create_default_context(cadata=credentials.authority)
    context.load_cert_chain(credentials.file)
    try:
        with (
            socket.create_connection((host, port), _PATIENCE_S) as plain,
            context.wrap_socket(plain, server_hostname=host) as secure,
        ):
            secure.recv(1)  # in TLS 1.3 the verdict on our certificate comes after the handshake
    except ssl.SSLCertVerificationError as error:
        return _verdict_on_hub(host, error, credentials)
    except ssl.SSLError as error:
        reason = error.reason or str(error)
        verdict = next((words for alert, words in _VERDICTS.items() if alert in reason), "")
        if verdict:
            return (
                f"the certificate {credentials.file} {verdict}. On the hub's machine: trocar certs issue"
                f" {credentials.name}; then copy it here anew"
            )
        return (
            f"who listens there does not speak TLS as a hub does ({reason}); start it with --listen"
            f" tls/0.0.0.0:{port}"
        )
    except socket.gaierror:
        return (
            f"'{host}' is no name that this machine knows; give the address instead, or mend the name service"
        )
    except ConnectionRefusedError:
        return f"nobody listens there. Is it running, with --listen tls/0.0.0.0:{port}?"
    except TimeoutError:
        return (
            ""
            if _answers(host, port)
            else (
                "nothing answers. Is the address right, and does the firewall of the hub's machine let TCP"
                f" port {port} in?"
            )
        )
    except OSError as error:
        return f"{error}"
    return ""


def _verdict_on_hub(host: str, error: ssl.SSLCertVerificationError, credentials: Credentials) -> str:
    if "expired" in error.verify_message:
        return "its certificate has expired. On its machine: trocar certs renew"
    if "match" in error.verify_message:
        return (
            f"its certificate is not for the name '{host}'. On its machine, trocar certs show tells the"
            " names; to have others: trocar certs renew NAME ..."
        )
    mends = f"on the hub's machine: trocar certs issue {credentials.name}; then copy it here anew"
    return (
        f"its certificate is of another authority than {credentials.file} ({error.verify_message}). To mend"
        f" it, {mends}"
    )


def _answers(host: str, port: int) -> bool:
    try:
        with socket.create_connection((host, port), _PATIENCE_S):
            return True
    except OSError:
        return False
