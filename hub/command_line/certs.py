"""`trocar certs`: the certificates of a hub and of participants on remote machines."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from hub.command_line.display import results, table
from schemas.errors import ConnectError, MissingExtraError

__all__ = ["app"]

app = typer.Typer(
    help="Create, revoke and show the certificates with which a hub and other machines identify each other.",
    no_args_is_help=True,
)

_HUB_DAYS = 397
"""A year, and a month to renew: the longest time accepted by browsers for a server.

Source: CA/Browser Forum, Baseline Requirements 6.3.2.
"""

_PARTICIPANT_DAYS = 30
"""A short time: the loss of a certificate may stay unnoticed."""

_LEAST_DAYS, _MOST_DAYS = 0.01, 3650
"""A quarter of an hour, for a trial; ten years, as the authority's own certificate."""

Directory = Annotated[
    Path | None,
    typer.Option(
        "--dir",
        metavar="DIR",
        file_okay=False,
        help="Where the certificates are; default: the directory of this user.",
    ),
]
Hosts = Annotated[
    list[str] | None,
    typer.Argument(metavar="HOST", help="A name or address at which other machines reach this one."),
]


def _directory(given: Path | None) -> Path:
    from hub.security.credentials import default_directory

    return given or default_directory()


@app.command()
def init(
    hosts: Hosts = None,
    *,
    directory: Directory = None,
    days: Annotated[
        float, typer.Option(min=_LEAST_DAYS, max=_MOST_DAYS, help="How long the hub's certificate is valid.")
    ] = _HUB_DAYS,
) -> None:
    """Create an authority and the certificate of this machine's hub.

    Do this once, on the machine where the hub runs.
    """
    _require_cryptography()
    from hub.security.certs import create_authority, names_of_this_machine

    file = create_authority(_directory(directory), hosts or names_of_this_machine(), days)
    results.print(
        f"wrote {file}, for the hub, and beside it the authority ca.pem with its key ca.key: keep that key"
        " secret",
        soft_wrap=True,
    )
    _print_names(file)
    results.print("next, for each participant on another machine: trocar certs issue NAME", soft_wrap=True)


@app.command()
def renew(
    hosts: Hosts = None,
    *,
    directory: Directory = None,
    days: Annotated[
        float, typer.Option(min=_LEAST_DAYS, max=_MOST_DAYS, help="How long the certificate is valid.")
    ] = _HUB_DAYS,
) -> None:
    """Create a new certificate for the hub, with the same names unless others are given."""
    _require_cryptography()
    from hub.security.certs import renew as make

    file = make(_directory(directory), hosts or (), days)
    results.print(f"wrote {file}; the next session uses it", soft_wrap=True)
    _print_names(file)


@app.command()
def issue(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help=(
                "A participant with `host: remote`; or `observer`, to read the status; or `console`, for ROS"
                " programs."
            ),
        ),
    ],
    *,
    directory: Directory = None,
    days: Annotated[
        float, typer.Option(min=_LEAST_DAYS, max=_MOST_DAYS, help="How long the certificate is valid.")
    ] = _PARTICIPANT_DAYS,
) -> None:
    """Create the certificate of a participant on another machine.

    An older certificate of the participant stays valid until expiry or revocation.
    """
    _require_cryptography()
    from hub.security.certs import issue as make
    from hub.security.credentials import CONSOLE, OBSERVER

    file = make(_directory(directory), name, days)
    uses = {
        OBSERVER: "trocar ls --connect tls/HUB:7447",
        CONSOLE: "the Zenoh settings of the ROS programs, to connect to tls/HUB:7447 (docs/ros.md)",
    }
    use = uses.get(name, f"trocar device {name} --connect tls/HUB:7447")
    results.print(
        f"wrote {file}, which is all that the other machine needs. Copy it there over a channel that others"
        " cannot read, to one of",
        soft_wrap=True,
    )
    results.print(
        "    ~/.config/trocar/certs/            (Linux)\n    %APPDATA%\\trocar\\certs\\           (Windows)"
    )
    results.print("    ~/Library/Application Support/trocar/certs/  (macOS)", soft_wrap=True)
    results.print(f"and use it there with: {use}", soft_wrap=True)


@app.command()
def revoke(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="A participant, `observer` or `console`: as in `issue`.")
    ],
    *,
    directory: Directory = None,
) -> None:
    """Let a hub reject all certificates of NAME, for instance after the loss of a file.

    Running hubs with this directory end the connections of NAME within a second or two.
    """
    _require_cryptography()
    from hub.security.certs import revoke as ban
    from hub.security.revoked import FILE

    place = _directory(directory)
    common_name = ban(place, name)
    results.print(
        f"wrote '{common_name}' to {place / FILE}: hubs on this machine reject it from now on", soft_wrap=True
    )
    results.print(f"for a new certificate: trocar certs issue {name}", soft_wrap=True)


@app.command()
def show(*, directory: Directory = None) -> None:
    """List the certificates of this machine, with their purpose and date of expiry."""
    from hub.security.credentials import CONSOLE, HUB, OBSERVER, examine, load
    from hub.security.revoked import FILE, read

    place = _directory(directory)
    revoked = read(place / FILE)
    rows: list[tuple[str, str, str]] = []
    for file in sorted(place.glob("*.pem")):
        if file.name == "ca.pem":
            continue
        try:
            certificate = examine(load(file.stem, place))
        except ConnectError as error:
            rows.append((file.stem, "invalid", str(error)))
            continue
        if certificate.common_name in revoked:
            rows.append((file.stem, "revoked", f"for a new one: trocar certs issue {certificate.name}"))
            continue
        role = {
            HUB: f"a hub at {', '.join(certificate.hosts)}",
            OBSERVER: "observers of the status",
            CONSOLE: "ROS programs",
        }
        days = (certificate.until - datetime.now(UTC)).days
        until = f"{certificate.until:%Y-%m-%d %H:%M} UTC ({days} days)"
        rows.append((file.stem, until, role.get(certificate.name, f"participant {certificate.name}")))
    results.print(table(rows, "file", "valid until", "for") if rows else f"no certificate in {place}")


def _print_names(file: Path) -> None:
    from hub.security.credentials import examine, load

    results.print(f"names of this hub: {', '.join(examine(load(file.stem, file)).hosts)}", soft_wrap=True)


def _require_cryptography() -> None:
    from importlib.util import find_spec

    if find_spec("cryptography") is None:
        raise MissingExtraError("creating certificates", "certs", "cryptography")
