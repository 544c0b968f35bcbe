"""How many files and sockets the processes of a session need to have open, and the system's limit of them."""

from __future__ import annotations

import sys
from collections import Counter

from hub.planning.plan import Plan
from schemas.errors import SessionError

__all__ = ["allow_open_files"]

_OF_ANY = 32
"""Python, Zenoh and the engines of one host; 25 were measured in the host of the cameras."""

_OF_A_HOST = 6
"""The connection with another host, the pipes with which its process is started, and the link to it."""


def allow_open_files(plan: Plan) -> None:
    """Raise this process' own limit, which hosts inherit, to what a session of `plan` needs.

    Raises SessionError if the system does not allow that. Otherwise an import, a connection or the recording
    would fail somewhere in the middle, for a reason that is hard to find.
    """
    if sys.platform == "win32":  # has no such limit
        return
    import resource

    needed = _needed(plan)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= needed:
        return
    if hard != resource.RLIM_INFINITY and hard < needed:
        raise SessionError(
            f"each process may have {hard} files and sockets open (ulimit -n), and one of this session needs"
            f" about {needed}. Start it after: ulimit -n {max(1024, needed)}; or put more of its participants"
            " into one host"
        )
    resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))


def _needed(plan: Plan) -> int:
    """Return the number for the process that needs most."""
    hosts = {name: planned.host for name, planned in plan.participants.items()}
    between = {
        (connection.source, connection.source_port, hosts[connection.target])
        for connection in plan.connections
        if hosts[connection.source] != hosts[connection.target]
    }
    used: Counter[str] = Counter()
    for source, _, reader in between:
        used[hosts[source]] += 1  # as in hub.transport.lane
        used[reader] += 2
    return _OF_ANY + _OF_A_HOST * len(set(hosts.values())) + max(used.values(), default=0)
