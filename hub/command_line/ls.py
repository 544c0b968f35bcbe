"""`trocar ls`: the sessions that are running."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import typer
from rich.console import Console

from hub.command_line.display import LATENCY_COLUMNS, latency_rows, table
from hub.command_line.options import Certificates, HubEndpoints, Json
from hub.observation.latency import by_way
from schemas.trocar_msgs import SessionStatus

__all__ = ["ls"]

_PARTICIPANT_COLUMNS = ("session", "state", "name", "role", "host", "pid", "step")
_DEVICE_COLUMNS = ("session", "device", "clock offset", "within", "network link")


def ls(*, connect: HubEndpoints = None, certs: Certificates = None, as_json: Json = False) -> None:
    """List the running sessions: participants, clocks and network links of devices, latencies."""
    from hub.remote.live_sessions import live_sessions
    from hub.transport.endpoints import listening_endpoints

    sessions = live_sessions(connect or listening_endpoints(), certs)
    if as_json:
        typer.echo(json.dumps([_session_row(status) for status in sessions], indent=2))
        return
    out = Console(highlight=False)
    if not sessions:
        out.print("no session is running")
        return
    rows = [
        (s.session, s.state, p.name, p.role, p.host, p.pid, p.step) for s in sessions for p in s.participants
    ]
    out.print(table(rows, *_PARTICIPANT_COLUMNS))
    if devices := [row for status in sessions for row in _device_rows(status)]:
        out.print()
        out.print(table(devices, *_DEVICE_COLUMNS))
    latencies = [
        (status.session, *row) for status in sessions for row in latency_rows(by_way(status.latencies))
    ]
    if latencies:
        out.print()
        out.print(table(latencies, "session", *LATENCY_COLUMNS))


def _session_row(status: SessionStatus) -> dict[str, Any]:
    shown = {"participants": status.participants, "devices": status.devices, "latency": status.latencies}
    return {"session": status.session} | {
        name: [one.model_dump() for one in found] for name, found in shown.items()
    }


def _device_rows(status: SessionStatus) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the devices: the offset of their clock to the hub's, and its uncertainty."""
    for device in status.devices:
        measured = device.round_trip_ns >= 0
        offset = f"{device.offset_ns / 1e6:+.3f} ms" if measured else "same clock"
        within = f"{device.round_trip_ns / 2e6:.3f} ms" if measured else "-"
        yield status.session, device.device, offset, within, device.link or "-"
