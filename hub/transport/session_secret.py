"""The secret of a session: without the secret no process of this machine can connect to the hub or a host.

Loopback is open to every user of a machine. Zenoh demands user name and password for each connection; the
password is random and lasts as long as the hub. Hosts and commands read the password from a file readable by
this user alone (docs/decisions/0038-secret-of-a-session.md).
"""

from __future__ import annotations

import os
import secrets
import stat
import tempfile
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import zenoh

from hub.transport.endpoints import address
from hub.transport.loopback_port import LoopbackPort
from schemas.errors import ConnectError

__all__ = ["listen_with_secret", "private_directory", "secret_of"]

_USER = "trocar"
_BYTES = 32
_SETTINGS = "transport/auth/usrpwd"


def private_directory() -> Path:
    """Return the directory for files of this user's running sessions; only the user can open the directory.

    Raises ConnectError if the directory belongs to another user or is open to others.
    """
    user = f"-{os.getuid()}" if hasattr(os, "getuid") else ""  # Windows has a temporary directory per user
    directory = Path(tempfile.gettempdir(), f"trocar{user}")
    try:
        directory.mkdir(mode=0o700, exist_ok=True)
        found = directory.lstat()
    except OSError as error:
        raise ConnectError(
            f"{directory} cannot keep the secrets of sessions: {error}. Set TMPDIR to another directory"
        ) from error
    if hasattr(os, "getuid") and (
        not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or stat.S_IMODE(found.st_mode) & 0o077
    ):
        raise ConnectError(
            f"{directory} must be a directory of this user with mode 0700, as it keeps the secrets of"
            " sessions: remove it, or set TMPDIR to another directory"
        )
    return directory


def _file(endpoint: str) -> Path:
    return private_directory() / str(address(endpoint)[1])


@contextmanager
def listen_with_secret(port: LoopbackPort, connect: Sequence[str] = ()) -> Generator[zenoh.Session]:
    """Open the hub's Zenoh session on `port` with a new secret; remove the secret at the end.

    `connect`: further endpoints for the hub to connect to; these do not demand a secret.

    Raises ConnectError if the port is taken, or if there is no private directory.
    """
    handle, name = tempfile.mkstemp(dir=private_directory())  # with mode 0600
    file = Path(name)
    try:
        with os.fdopen(handle, "w", encoding="ascii") as written:
            written.write(f"{_USER}:{secrets.token_hex(_BYTES)}\n")
        settings = {f"{_SETTINGS}/dictionary_file": name}
        session = port.listen(connect=connect, security=settings, alone=not connect)
        with session:
            # now that the port is this hub's: another one's file must not be replaced
            file = file.replace(_file(port.endpoint))
            try:
                yield session
            finally:
                file.unlink(missing_ok=True)  # before the port is free for another hub
    finally:
        Path(name).unlink(missing_ok=True)


def secret_of(endpoint: str) -> dict[str, Any]:
    """Return Zenoh's settings for a connection to the hub at `endpoint` on this machine.

    A peer demands the same secret for connections to itself. Raises ConnectError if no hub of this user
    listens there.
    """
    file = _file(endpoint)
    try:
        user, _, password = file.read_text(encoding="ascii").strip().partition(":")
    except OSError as error:
        mine = sorted(int(other.name) for other in file.parent.iterdir() if other.name.isdecimal())
        where = ", ".join(f"tcp/127.0.0.1:{number}" for number in mine) or "nowhere"
        raise ConnectError(
            f"no session of this user listens at {endpoint}; those of this user listen at: {where}. Only the"
            " user who has started a session can join it"
        ) from error
    return {
        f"{_SETTINGS}/user": user,
        f"{_SETTINGS}/password": password,
        f"{_SETTINGS}/dictionary_file": str(file),
    }
