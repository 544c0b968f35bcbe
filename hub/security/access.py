"""The access rules for other machines, generated from the plan, with denial by default.

A rule of Zenoh allows kinds of messages on keys in a direction: into the gate (ingress) or out of the gate
(egress), for a name in a certificate. The hub's machine, connected over loopback or by a socket of the file
system, may do everything, as without a gate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hub.planning.plan import ConnectionToDevice, Plan, PlannedParticipant
from hub.security.credentials import CONSOLE, OBSERVER
from schemas.keys import Keys

__all__ = ["ALL_MESSAGES", "access_settings", "allow"]

ALL_MESSAGES = (
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
)

_DEVICE_BYTES = 2**20
"""The largest message of a device: a colour image of 640 x 480 pixels fits."""

_MOST_BYTES = 2**25
"""Largest message of any client: Zenoh collects fragments in memory before applying the rules."""

Rule = dict[str, Any]


def access_settings(
    plan: Plan, session: str, foreign: Mapping[str, Sequence[str]] | None = None
) -> dict[str, Any]:
    """Return Zenoh's settings for the rights of each remote participant of `plan` in `session`.

    `foreign`: keys shared with programs (connected with the certificate `console`), by device.
    """
    keys = Keys(session)
    rights = {
        planned.name: _part(plan, keys, planned)
        for planned in plan.participants.values()
        if planned.host.startswith("remote/")
    }
    # all that `trocar ls` needs
    rights[OBSERVER] = [
        *rights.get(OBSERVER, ()),
        *_query_messages(Keys("*").status, Keys("*").profile),
        *_subscribe_messages(keys.status),
    ]
    everything = ["**"]  # does not match chunks that begin with @, as in some foreign keys
    for name, shared in (foreign or {}).items():
        everything += shared
        for holder in (CONSOLE, name) if name in rights else (CONSOLE,):
            rights[holder] = [*rights.get(holder, ()), allow("both", ALL_MESSAGES, *shared)]
    rules = {f"{name} {index}": rule for name, own in rights.items() for index, rule in enumerate(own)}
    access = {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            {"id": "local", **allow("both", ALL_MESSAGES, *everything)},
            *({"id": name, **rule} for name, rule in rules.items()),
        ],
        "subjects": [
            {"id": "local", "link_protocols": ["tcp", "unixsock-stream"]},
            *({"id": name, "cert_common_names": [name]} for name in rights),
        ],
        "policies": [
            {"subjects": ["local"], "rules": ["local"]},
            *(
                {"subjects": [name], "rules": [f"{name} {index}" for index in range(len(own))]}
                for name, own in rights.items()
            ),
        ],
    }
    size = {
        "id": "devices",
        "link_protocols": ["tls"],
        "flows": ["ingress"],
        "messages": ["put", "query"],
        "key_exprs": [f"{keys.prefix}/device/**", f"{Keys('*').prefix}/control/**"],
        "size_limit": _DEVICE_BYTES,
    }
    limits = {"low_pass_filter": [size], "transport/link/rx/max_message_size": _MOST_BYTES}
    # a client must not learn the addresses of others
    return {"access_control": access, **limits, "scouting/gossip/enabled": False}


def _part(plan: Plan, keys: Keys, planned: PlannedParticipant) -> list[Rule]:
    """Return the rights of a remote participant."""
    name, role, hub = planned.name, planned.key_role, keys.alive("hub", "hub")
    inputs = [
        keys.output("engine", connection.source, connection.source_port)
        for connection in plan.connections
        if connection.target == name
    ] + [_to_device(plan, keys, connection) for connection in plan.to_devices if connection.target == name]
    orders = [keys.link(name)] if role == "device" else [] if planned.observer else [keys.grant]
    orders += [keys.uses(one.target, name) for one in plan.to_devices if one.source == name]
    # the hub subscribes to these of all participants at once
    of_all = [
        keys.device_status("*"),
        keys.observer_status("*"),
        keys.dropped_messages("*", "*"),
        keys.ack("*"),
    ]
    return [
        allow("ingress", ["put"], f"{keys.prefix}/{role}/{name}/**"),
        allow("egress", ["declare_subscriber"], f"{keys.prefix}/{role}/{name}/**", *of_all),
        allow("ingress", ["liveliness_token"], keys.alive(role, name)),
        *_query_messages(Keys("*").join(planned.host), keys.control("clock")),
        *_subscribe_messages(*dict.fromkeys([*inputs, *orders])),
        allow("ingress", ["liveliness_query", "declare_liveliness_subscriber"], hub),
        allow("egress", ["liveliness_token"], hub),
    ]


def _to_device(plan: Plan, keys: Keys, connection: ConnectionToDevice) -> str:
    """Return the key of a connection's values to a device or an observer."""
    if plan.participants[connection.source].port(connection.source_port).variability == "event":
        return keys.feed(connection.source, connection.source_port)
    return keys.signals(connection.source, connection.target)


def _query_messages(*keys: str) -> list[Rule]:
    return [allow("ingress", ["query"], *keys), allow("egress", ["reply", "declare_queryable"], *keys)]


def _subscribe_messages(*keys: str) -> list[Rule]:
    return [allow("ingress", ["declare_subscriber"], *keys), allow("egress", ["put"], *keys)]


def allow(flow: str, messages: Sequence[str], *keys: str) -> Rule:
    """Return a rule to allow `messages` on `keys`, in the direction `flow` or in both."""
    flows = ["ingress", "egress"] if flow == "both" else [flow]
    return {"permission": "allow", "flows": flows, "messages": list(messages), "key_exprs": list(keys)}
