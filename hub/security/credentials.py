"""The identity of this machine: a PEM file with key, certificate, and the authority of both sides."""

from __future__ import annotations

import base64
import re
import ssl
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import typer

from hub.security.revoked import holder
from schemas.errors import ConnectError

__all__ = ["CONSOLE", "HUB", "OBSERVER", "Certificate", "Credentials", "default_directory", "examine", "load"]

HUB = "hub"
"""Name of a hub's certificate."""

CONSOLE = "console"
"""Name of the certificate of programs sharing keys with devices of a session, such as gateways to ROS.

The certificate gives access to the shared keys and nothing else.
"""

OBSERVER = "observer"
"""Name of the certificate with access to the status of a session, and nothing else."""

_KEY = re.compile("-----BEGIN PRIVATE KEY-----.*?-----END PRIVATE KEY-----\n", re.DOTALL)
_CERTIFICATE = re.compile("-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----\n", re.DOTALL)


@dataclass(frozen=True)
class Credentials:
    """The contents of a PEM file: key, certificate, authority, in this order."""

    file: Path
    key: str
    certificate: str
    authority: str

    @property
    def name(self) -> str:
        """The name in the certificate: a participant, `hub`, `observer` or `console`."""
        return self.file.stem

    def listening(self) -> dict[str, Any]:
        """Return Zenoh's settings for a hub: certificates are required, and expiry disconnects."""
        return self._settings("listen") | {"transport/link/tls/close_link_on_expiration": True}

    def connecting(self) -> dict[str, Any]:
        """Return Zenoh's settings for a client.

        The hub must have a certificate of the same authority, for the name in the endpoint.
        """
        return self._settings("connect") | {"transport/link/tls/verify_name_on_connect": True}

    def _settings(self, side: str) -> dict[str, Any]:
        parts = {
            "root_ca_certificate": self.authority,
            f"{side}_private_key": self.key,
            f"{side}_certificate": self.certificate,
        }
        encoded = {
            f"transport/link/tls/{part}_base64": base64.b64encode(text.encode()).decode()
            for part, text in parts.items()
        }
        return {"transport/link/tls/enable_mtls": True, **encoded}


@dataclass(frozen=True)
class Certificate:
    """The contents of a valid certificate."""

    common_name: str
    until: datetime
    hosts: tuple[str, ...]
    """Names and addresses of a hub."""

    @property
    def name(self) -> str:
        """The holder: a participant, `hub`, `observer` or `console`."""
        return holder(self.common_name)


def default_directory() -> Path:
    """Return this user's directory of certificates.

    `~/.config/trocar/certs`, or on Windows `trocar/certs` in `%APPDATA%`.
    """
    return Path(typer.get_app_dir("trocar")) / "certs"


def load(name: str, where: Path | None = None) -> Credentials:
    """Return the credentials in the file `where`, or the credentials `name` in the directory `where`.

    `where` is by default this user's directory. Raises ConnectError for a missing or different file.
    """
    place = default_directory() if where is None else where
    file = place if place.is_file() else place / f"{name}.pem"
    remedy = (
        "trocar certs init"
        if name == HUB
        else f"trocar certs issue {name}, on the hub's machine; then copy the file that it names to {place}"
    )
    try:
        text = file.read_text(encoding="ascii")
    except FileNotFoundError as error:
        raise ConnectError(
            f"there is no certificate {file}, which connections between machines need. To create it: {remedy}"
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise ConnectError(f"the certificate {file} cannot be read: {error}") from error
    keys, certificates = _KEY.findall(text), _CERTIFICATE.findall(text)
    if (len(keys), len(certificates)) != (1, 2):
        raise ConnectError(
            f"{file} is no file of `trocar certs`, which have a key, its certificate and its authority. To"
            f" create one: {remedy}"
        )
    return Credentials(file, keys[0], *certificates)


def examine(credentials: Credentials) -> Certificate:
    """Return the contents of a certificate, verified against the authority as in a connection.

    Raises ConnectError for an expired certificate, another authority, or another key.
    """
    try:
        verified = _verified(credentials)
    except ssl.SSLError as error:
        reason = (
            error.verify_message
            if isinstance(error, ssl.SSLCertVerificationError)
            else error.reason or str(error)
        )
        again = "renew" if credentials.name == HUB else f"issue {credentials.name}"
        raise ConnectError(
            f"{credentials.file} is not valid: {reason}. To replace it, on the hub's machine: trocar certs"
            f" {again}"
        ) from error
    subject: dict[str, str] = {key: value for ((key, value),) in verified["subject"]}
    until = datetime.fromtimestamp(ssl.cert_time_to_seconds(verified["notAfter"]), UTC)
    return Certificate(
        subject["commonName"], until, tuple(value for _, value in verified.get("subjectAltName", ()))
    )


def _verified(credentials: Credentials) -> dict[str, Any]:
    """Return the certificate as seen by a peer, from a handshake in memory.

    Raises SSLError if the peer rejects the certificate.
    """
    contexts = {side: ssl.SSLContext(side) for side in (ssl.PROTOCOL_TLS_SERVER, ssl.PROTOCOL_TLS_CLIENT)}
    for context in contexts.values():
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    contexts[ssl.PROTOCOL_TLS_SERVER].load_cert_chain(credentials.file)
    contexts[ssl.PROTOCOL_TLS_CLIENT].load_cert_chain(credentials.file)
    verifier = ssl.PROTOCOL_TLS_CLIENT if credentials.name == HUB else ssl.PROTOCOL_TLS_SERVER
    contexts[verifier].verify_mode = ssl.CERT_REQUIRED
    contexts[verifier].load_verify_locations(cadata=credentials.authority)
    to_client, to_server = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = {
        ssl.PROTOCOL_TLS_CLIENT: contexts[ssl.PROTOCOL_TLS_CLIENT].wrap_bio(to_client, to_server),
        ssl.PROTOCOL_TLS_SERVER: (
            contexts[ssl.PROTOCOL_TLS_SERVER].wrap_bio(to_server, to_client, server_side=True)
        ),
    }
    for _ in range(3):  # hello, the server's part, the client's part
        for end in ends.values():
            with suppress(ssl.SSLWantReadError):
                end.do_handshake()
    certificate = ends[verifier].getpeercert()
    if not certificate:
        raise ssl.SSLError("the handshake did not finish")
    return dict(certificate)
