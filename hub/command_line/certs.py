"""`trocar certs`: the certificates by which a hub and participants on other machines know each other."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from hub.command_line.display import console, table
from schemas.errors import ConnectError, MissingExtraError

__all__ = ["app"]

app = typer.Typer(
    help="Make and show the certificates by which a hub and other machines know each other.",
    no_args_is_help=True,
)

_HUB_DAYS = 397
"""What browsers accept of a server at most (CA/Browser Forum, Baseline Requirements 6.3.2): a year, and a
month to renew it.
"""

_PARTICIPANT_DAYS = 30
"""There is no list of certificates that are revoked: one that is lost must not be worth much for long."""

_LEAST_DAYS, _MOST_DAYS = 0.01, 3650
"""A quarter of an hour, for a try; the authority's own ten years."""

Directory = Annotated[
    Path | None,
    typer.Option(
        "--dir",
        metavar="DIR",
        file_okay=False,
        help="Where the certificates are; by default this user's own.",
    ),
]
Hosts = Annotated[
    list[str] | None,
    typer.Argument(metavar="HOST", help="A name or an address by which other machines reach this one."),
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
        float, typer.Option(min=_LEAST_DAYS, max=_MOST_DAYS, help="How long the hub's is valid.")
    ] = _HUB_DAYS,
) -> None:
    """Make an authority and the certificate of this machine's hub: once, on the machine where the hub runs."""
    _needs_cryptography()
    from hub.security.certs import found, names_of_this_machine

    file = found(_directory(directory), hosts or names_of_this_machine(), days)
    console.print(
        f"wrote {file}, for the hub, and the authority ca.pem with its key ca.key beside it: keep that key to"
        " yourself",
        soft_wrap=True,
    )
    _print_names(file)
    console.print("next, for each participant on another machine: trocar certs issue NAME", soft_wrap=True)


@app.command()
def renew(
    hosts: Hosts = None,
    *,
    directory: Directory = None,
    days: Annotated[
        float, typer.Option(min=_LEAST_DAYS, max=_MOST_DAYS, help="How long it is valid.")
    ] = _HUB_DAYS,
) -> None:
    """Make a new certificate for the hub, with the same names unless others are given."""
    _needs_cryptography()
    from hub.security.certs import renew as make

    file = make(_directory(directory), hosts or (), days)
    console.print(f"wrote {file}; it counts from the next session on", soft_wrap=True)
    _print_names(file)


@app.command()
def issue(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help=(
                "A participant with `host: remote`; `observer` reads the status, `console` is for ROS"
                " programs."
            ),
        ),
    ],
    *,
    directory: Directory = None,
    days: Annotated[
        float, typer.Option(min=_LEAST_DAYS, max=_MOST_DAYS, help="How long it is valid.")
    ] = _PARTICIPANT_DAYS,
) -> None:
    """Make the certificate of one participant, for another machine; an older one stays valid as long as it
    is.
    """
    _needs_cryptography()
    from hub.security.certs import issue as make
    from hub.security.credentials import CONSOLE, OBSERVER

    file = make(_directory(directory), name, days)
    uses = {
        OBSERVER: "trocar ls --connect tls/HUB:7447",
        CONSOLE: "in the Zenoh settings of the ROS programs, to connect to tls/HUB:7447 (docs/ros.md)",
    }
    use = uses.get(name, f"trocar device {name} --connect tls/HUB:7447")
    console.print(
        f"wrote {file}, all that the other machine needs. Copy it there, by a way that nobody else can read,"
        " to one of",
        soft_wrap=True,
    )
    console.print(
        "    ~/.config/trocar/certs/            (Linux)\n    %APPDATA%\\trocar\\certs\\           (Windows)"
    )
    console.print("    ~/Library/Application Support/trocar/certs/  (macOS)", soft_wrap=True)
    console.print(f"and use it there: {use}", soft_wrap=True)


@app.command()
def show(*, directory: Directory = None) -> None:
    """List the certificates of this machine, until when they are valid and for what."""
    from hub.security.credentials import CONSOLE, HUB, OBSERVER, examine, load

    place = _directory(directory)
    rows: list[tuple[str, str, str]] = []
    for file in sorted(place.glob("*.pem")):
        if file.name == "ca.pem":
            continue
        try:
            certificate = examine(load(file.stem, place))
        except ConnectError as error:
            rows.append((file.stem, "not valid", str(error)))
            continue
        role = {
            HUB: f"a hub at {', '.join(certificate.hosts)}",
            OBSERVER: "reading the status of sessions",
            CONSOLE: "ROS programs",
        }
        left = certificate.until - datetime.now(UTC)
        rows.append(
            (
                file.stem,
                f"{certificate.until:%Y-%m-%d %H:%M} UTC ({left.days} days)",
                role.get(certificate.name, f"participant {certificate.name}"),
            )
        )
    Console(highlight=False).print(
        table(rows, "file", "valid until", "for") if rows else f"there is no certificate in {place}"
    )


def _print_names(file: Path) -> None:
    from hub.security.credentials import examine, load

    console.print(
        f"other machines may reach it as {', '.join(examine(load(file.stem, file)).hosts)}", soft_wrap=True
    )


def _needs_cryptography() -> None:
    from importlib.util import find_spec

    if find_spec("cryptography") is None:
        raise MissingExtraError("making certificates", "certs", "cryptography")
