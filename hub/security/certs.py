"""The authority of a hub, issuer of the certificates of the hub and of participants.

Keys are of the elliptic curve P-256, supported by every TLS library. Needs the extra `certs`. The design:
docs/decisions/0027-remote-hosts.md.
"""

from __future__ import annotations

import os
import secrets
import socket
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from hub.security import revoked
from hub.security.credentials import CONSOLE, HUB, OBSERVER, examine, load
from schemas.errors import ConnectError, ScenarioError
from schemas.keys import valid_name

__all__ = ["create_authority", "issue", "names_of_this_machine", "renew", "revoke"]

_AUTHORITY_DAYS = 3650
_SKEW = timedelta(hours=1)
"""Age of new certificates: the clock of a remote machine may be behind."""


def create_authority(directory: Path, hosts: Sequence[str], days: float) -> Path:
    """Create an authority in `directory` and the hub's certificate for `hosts`; return its file.

    `hosts`: names and addresses of the hub. Raises ScenarioError if there is an authority already: all
    certificates issued so far would become useless.
    """
    key_file, certificate_file = directory / "ca.key", directory / "ca.pem"
    if key_file.exists() or certificate_file.exists():
        raise ScenarioError(
            f"{directory} has an authority already, which issued the certificates in use. For a new"
            " certificate of the hub alone: trocar certs renew. To start afresh, move that directory away"
        )
    directory.mkdir(parents=True, exist_ok=True, mode=0o700)
    key = ec.generate_private_key(ec.SECP256R1())
    # longer ones are invalid (RFC 5280, ub-common-name)
    name = _distinguished_name(f"Trocar authority {secrets.token_hex(4)} of {socket.gethostname()}"[:64])
    signs = dict.fromkeys(("key_cert_sign", "crl_sign"), True)
    other = (
        "digital_signature",
        "content_commitment",
        "key_encipherment",
        "data_encipherment",
        "key_agreement",
        "encipher_only",
        "decipher_only",
    )
    builder = _certificate_builder(name, name, key, datetime.now(UTC) + timedelta(days=_AUTHORITY_DAYS))
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(x509.KeyUsage(**signs, **dict.fromkeys(other, False)), critical=True)
    _write(key_file, _key_pem(key))
    _write(certificate_file, builder.sign(key, hashes.SHA256()).public_bytes(Encoding.PEM))
    return _issue_certificate(directory, HUB, days, hosts)


def renew(directory: Path, hosts: Sequence[str], days: float) -> Path:
    """Replace the hub's certificate, for `hosts` or (if empty) the present hosts; return the file.

    Raises ConnectError if `hosts` is empty and the present certificate is missing or invalid.
    """
    if not hosts:
        try:
            hosts = examine(load(HUB, directory)).hosts
        except ConnectError as error:
            raise ConnectError(
                "the names of the hub are unknown, as its certificate is missing or invalid; give them with"
                f" trocar certs renew HOST ... ({error})"
            ) from error
    return _issue_certificate(directory, HUB, days, hosts)


def issue(directory: Path, name: str, days: float) -> Path:
    """Create a certificate for the participant `name`, `observer` or `console`, and return the file.

    The remote machine needs nothing but this file; an older file is replaced. Raises ScenarioError for an
    invalid name, ConnectError if `directory` has no authority.
    """
    _check_holder(name)
    return _issue_certificate(directory, name, days)


def revoke(directory: Path, name: str) -> str:
    """Revoke every certificate of `name`, and return their common name; running hubs read the list.

    Raises ScenarioError for an invalid name, ConnectError if `directory` has no authority.
    """
    if name == HUB:
        raise ScenarioError(
            "the hub's certificate cannot be revoked, as other machines read no list: if its file was stolen,"
            f" move {directory} away and start afresh with trocar certs init"
        )
    _check_holder(name)
    _load_authority(directory)
    return revoked.add(directory / revoked.FILE, name)


def names_of_this_machine() -> list[str]:
    """Return the names and addresses of this machine for remote machines."""
    names = {socket.gethostname(), socket.getfqdn(), "localhost"}
    with suppress(OSError):
        names |= {str(info[4][0]) for info in socket.getaddrinfo(socket.gethostname(), None)}
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        # an address for documentation (RFC 5737): nothing is sent; the system chooses our own address
        probe.connect(("192.0.2.1", 9))
        names.add(probe.getsockname()[0])
    # with % it is valid for one network card only
    return sorted(name for name in names if "%" not in name)


def _check_holder(name: str) -> None:
    if not valid_name(name) or name in (HUB, "ca"):
        raise ScenarioError(
            f"'{name}' cannot have a certificate: give the name of a participant with 'host: remote' in the"
            f" scenario, '{OBSERVER}', or '{CONSOLE}' for ROS programs"
        )


def _issue_certificate(directory: Path, name: str, days: float, hosts: Sequence[str] = ()) -> Path:
    authority_key, authority = _load_authority(directory)
    key = ec.generate_private_key(ec.SECP256R1())
    until = min(datetime.now(UTC) + timedelta(days=days), authority.not_valid_after_utc)
    purpose = ExtendedKeyUsageOID.SERVER_AUTH if name == HUB else ExtendedKeyUsageOID.CLIENT_AUTH
    common_name = revoked.common_name(name, revoked.read(directory / revoked.FILE))
    builder = _certificate_builder(_distinguished_name(common_name), authority.subject, key, until)
    builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
    builder = builder.add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
    if hosts:
        builder = builder.add_extension(
            x509.SubjectAlternativeName([_host(host) for host in hosts]), critical=False
        )
    file = directory / f"{name}.pem"
    file.unlink(missing_ok=True)
    chain = builder.sign(authority_key, hashes.SHA256()), authority
    _write(file, _key_pem(key) + b"".join(certificate.public_bytes(Encoding.PEM) for certificate in chain))
    return file


def _load_authority(directory: Path) -> tuple[ec.EllipticCurvePrivateKey, x509.Certificate]:
    try:
        key = load_pem_private_key((directory / "ca.key").read_bytes(), None)
        certificate = x509.load_pem_x509_certificate((directory / "ca.pem").read_bytes())
    except (OSError, ValueError) as error:
        raise ConnectError(
            f"{directory} has no authority that can be read ({error}). To create one, on the hub's machine:"
            " trocar certs init"
        ) from error
    if not isinstance(key, ec.EllipticCurvePrivateKey) or certificate.public_key() != key.public_key():
        raise ConnectError(f"{directory / 'ca.key'} is not the key of {directory / 'ca.pem'}")
    return key, certificate


def _certificate_builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, until: datetime
) -> x509.CertificateBuilder:
    return x509.CertificateBuilder(
        issuer, subject, key.public_key(), x509.random_serial_number(), datetime.now(UTC) - _SKEW, until
    )


def _distinguished_name(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _host(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _key_pem(key: ec.EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())


def _write(file: Path, content: bytes) -> None:
    """Write a new file, readable by the owner only."""
    with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as out:
        out.write(content)
