"""The revoked certificates of a hub: a common name per line, in a file beside the hub's certificate.

Zenoh's rules see nothing of a certificate but the common name. A participant's first certificates have the
participant's name; after a revocation the next certificates have NAME.2, then NAME.3. The choice:
docs/decisions/0040-revoked-certificates.md.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from itertools import count
from pathlib import Path

from schemas.errors import ConnectError

__all__ = ["FILE", "add", "common_name", "holder", "read"]

FILE = "revoked.txt"
"""Name of the file, in the directory of the hub's certificate."""

_COMMON_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(\.[0-9]+)?")


def read(file: Path) -> list[str]:
    """Return the common names of the certificates revoked by `file`: none for a missing file.

    Raises ConnectError for an unreadable file: without the list, a hub must let no machine in.
    """
    try:
        lines = file.read_text(encoding="ascii").splitlines()
    except FileNotFoundError:
        return []
    except (OSError, UnicodeDecodeError) as error:
        raise ConnectError(f"the list of revoked certificates {file} cannot be read: {error}") from error
    for number, line in enumerate(lines, 1):
        if not _COMMON_NAME.fullmatch(line):
            raise ConnectError(
                f"{file}:{number}: '{line}' is no name of a certificate, such as stylus or stylus.2, one a"
                " line; correct it, or use: trocar certs revoke NAME"
            )
    return lines


def add(file: Path, name: str) -> str:
    """Revoke the certificates of the participant `name`; return their common name."""
    revoked = common_name(name, read(file))
    with file.open("a", encoding="ascii") as out:
        out.write(f"{revoked}\n")
    return revoked


def common_name(name: str, revoked: Collection[str]) -> str:
    """Return the accepted common name of the participant `name`."""
    numbered = (name if number == 1 else f"{name}.{number}" for number in count(1))
    return next(candidate for candidate in numbered if candidate not in revoked)


def holder(common_name: str) -> str:
    """Return the holder of a certificate: the participant, `hub`, `observer` or `console`."""
    return common_name.partition(".")[0]
