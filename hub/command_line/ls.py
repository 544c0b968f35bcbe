"""`trocar ls`: the running sessions."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import typer

from hub.command_line.display import LATENCY_COLUMNS, console, latency_rows, results, show_tables, table
from hub.command_line.options import Certificates, HubEndpoints, Json
from hub.observation.latency import by_way
from hub.recording.profiles import profile_numbers
from schemas.trocar_msgs import SessionStatus

__all__ = ["ls"]

_SESSION_COLUMNS = ("session", "state", "listens at", "pid", "run")
_PARTICIPANT_COLUMNS = ("session", "state", "name", "role", "host", "pid", "step")
_DEVICE_COLUMNS = ("session", "device", "clock offset", "within", "network link")
_GATEWAY_COLUMNS = ("session", "gateway", "programs reach it at")
_PROFILE_COLUMNS = ("session", "core-seconds per simulated second", "most of it")


def ls(*, connect: HubEndpoints = None, certs: Certificates = None, as_json: Json = False) -> None:
    """List the running sessions: endpoints, participants, devices, gateways, latencies, processor time."""
    found = _find_sessions(connect, certs)
    if as_json:
        typer.echo(json.dumps([_session_row(session) for session in found], indent=2))
        return
    if not found:
        results.print("no session is running")
        return
    sessions = [session.status for session in found]
    results.print(
        table(
            (
                (s.session, s.state, ", ".join(endpoints), pid or "-", s.run)
                for s, endpoints, pid, *_ in found
            ),
            *_SESSION_COLUMNS,
        )
    )
    participants = [
        (s.session, s.state, p.name, p.role, p.host, p.pid, p.step) for s in sessions for p in s.participants
    ]
    latencies = [(s.session, *row) for s in sessions for row in latency_rows(by_way(s.latencies))]
    tables = (
        (_PARTICIPANT_COLUMNS, participants),
        (_DEVICE_COLUMNS, [row for status in sessions for row in _device_rows(status)]),
        (_GATEWAY_COLUMNS, [row for session in found for row in _gateway_rows(session)]),
        (_PROFILE_COLUMNS, [row for session in found for row in _profile_rows(session)]),
        (("session", *LATENCY_COLUMNS), latencies),
    )
    show_tables((columns, rows) for columns, rows in tables if rows)


class _Found(NamedTuple):
    """A session with an answer."""

    status: SessionStatus
    endpoints: tuple[str, ...]
    """Known endpoints of the hub."""
    pid: int | None
    """The hub's process, if run by this user on this machine."""
    profile: dict[str, Any] | None
    """Profile of a profiled session (`hub/recording/profiles.py`)."""
    gateways: dict[str, str]
    """Place of each gateway, where programs reach it: a master, a domain, an endpoint."""


def _find_sessions(connect: Sequence[str] | None, certificates: Path | None) -> list[_Found]:
    """Return the sessions at the endpoints `connect`, by default all of this machine, sorted by name."""
    from hub.remote.live_sessions import live_places, live_profiles, live_sessions
    from hub.transport.hub_files import running_hubs

    at = {
        endpoint: live_sessions([endpoint], certificates)
        for endpoint in connect or [hub.endpoint for hub in running_hubs()]
    }
    profiles = live_profiles([endpoint for endpoint, statuses in at.items() if statuses], certificates)
    with_devices = [one for one, statuses in at.items() if any(status.devices for status in statuses)]
    places: Mapping[tuple[str, str], str] = live_places(with_devices, certificates) if with_devices else {}
    hubs = {hub.endpoint: hub for hub in running_hubs()}  # again, as some may have begun in between
    found: dict[tuple[str, int], _Found] = {}
    for endpoint, statuses in at.items():
        hub = hubs.get(endpoint)
        if hub and not statuses:
            console.print(
                f"the hub at {endpoint}, process {hub.pid}, does not answer: it starts, or it is stopped"
            )
        outside, pid = (hub.outside, hub.pid) if hub else ((), None)
        for status in statuses:
            profile = profiles.get(status.run)
            numbers = None if profile is None else profile_numbers(profile)
            gateways = {name: place for (session, name), place in places.items() if session == status.session}
            row = _Found(status, (endpoint, *outside), pid, numbers, gateways)
            found.setdefault((status.session, status.run), row)
    return [found[key] for key in sorted(found)]


def _session_row(session: _Found) -> dict[str, Any]:
    status = session.status
    shown = {"participants": status.participants, "devices": status.devices, "latency": status.latencies}
    where = {"endpoints": session.endpoints, "pid": session.pid, "run": status.run, "state": status.state}
    return (
        {"session": status.session}
        | where
        | {name: [one.model_dump() for one in rows] for name, rows in shown.items()}
        | {"gateways": session.gateways, "profile": session.profile}
    )


def _gateway_rows(session: _Found) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the gateways; a gateway over Zenoh is reached at the hub."""
    for name, place in session.gateways.items():
        yield session.status.session, name, place or session.endpoints[0]


def _profile_rows(session: _Found) -> Iterator[tuple[str, ...]]:
    """Yield the row of a profiled session: processor time, and its largest users."""
    if session.profile is not None and session.profile["by_taker"]:
        taker, core_s = next(iter(session.profile["by_taker"].items()))
        yield session.status.session, f"{session.profile['core_s_per_sim_s']:.2f}", f"{taker} ({core_s:.2f})"


def _device_rows(status: SessionStatus) -> Iterator[tuple[str, ...]]:
    """Yield the rows of the devices: clock offset to the hub, and uncertainty of the offset."""
    for device in status.devices:
        measured = device.round_trip_ns >= 0
        offset = f"{device.offset_ns / 1e6:+.3f} ms" if measured else "same clock"
        within = f"{device.round_trip_ns / 2e6:.3f} ms" if measured else "-"
        yield status.session, device.device, offset, within, device.link or "-"
