"""Who may say and hear what from another machine: rules made of the plan, by which all that they do not name
is refused.

A rule of Zenoh allows kinds of messages on keys in a direction: into the gate (ingress) or out of it
(egress). Whom it is for, the name in the certificate says. The hub's own machine, which reaches the gate by
TCP over loopback, may do everything, as it may without a gate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hub.planning.plan import ConnectionToDevice, Plan, PlannedParticipant
from hub.security.credentials import CONSOLE, OBSERVER
from schemas.keys import Keys

__all__ = ["access_settings"]

_ALL = (
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
"""What a device may say in one message: a colour image of 640 x 480 pixels fits in."""

_MOST_BYTES = 2**25
"""What anybody may say in one message: Zenoh gathers its fragments before anybody looks at it."""

Rule = dict[str, Any]


def access_settings(
    plan: Plan, session: str, foreign: Mapping[str, Sequence[str]] | None = None
) -> dict[str, Any]:
    """Return Zenoh's settings by which each remote participant of `plan` may do its part in `session`, and
    nothing else.

    `foreign`: by the device, the keys that it shares with programs, which connect with the certificate
    `console`.
    """
    keys = Keys(session)
    rights = {
        planned.name: _part(plan, keys, planned)
        for planned in plan.participants.values()
        if planned.host.startswith("remote/")
    }
    # all that `trocar ls` needs
    rights[OBSERVER] = [*rights.get(OBSERVER, ()), *_asks(Keys("*").status), *_hears(keys.status)]
    everything = ["**"]  # but what has a chunk that begins with @, as some foreign keys have
    for name, shared in (foreign or {}).items():
        everything += shared
        for whose in (CONSOLE, name) if name in rights else (CONSOLE,):
            rights[whose] = [*rights.get(whose, ()), _allow("both", _ALL, *shared)]
    rules = {f"{name} {index}": rule for name, its in rights.items() for index, rule in enumerate(its)}
    access = {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            {"id": "local", **_allow("both", _ALL, *everything)},
            *({"id": name, **rule} for name, rule in rules.items()),
        ],
        "subjects": [
            {"id": "local", "link_protocols": ["tcp"]},
            *({"id": name, "cert_common_names": [name]} for name in rights),
        ],
        "policies": [
            {"subjects": ["local"], "rules": ["local"]},
            *(
                {"subjects": [name], "rules": [f"{name} {index}" for index in range(len(its))]}
                for name, its in rights.items()
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
    # who else is here, and at which address, is nobody's business
    return {"access_control": access, **limits, "scouting/gossip/enabled": False}


def _part(plan: Plan, keys: Keys, planned: PlannedParticipant) -> list[Rule]:
    """Return the rights of one remote participant."""
    name, role, hub = planned.name, planned.key_role, keys.alive("hub", "hub")
    links = [
        keys.output("engine", link.source, link.source_port)
        for link in plan.connections
        if link.target == name
    ]
    feeds = [_feed(plan, keys, outlet) for outlet in plan.to_devices if outlet.target == name]
    heard = list(dict.fromkeys(links + feeds))
    # as the hub does, to all participants at once
    listens = [keys.device_status("*"), keys.refused("*", "*"), keys.ack("*")]
    return [
        _allow("ingress", ["put"], f"{keys.prefix}/{role}/{name}/**"),
        _allow("egress", ["declare_subscriber"], f"{keys.prefix}/{role}/{name}/**", *listens),
        _allow("ingress", ["liveliness_token"], keys.alive(role, name)),
        *_asks(Keys("*").join(planned.host), keys.control("clock")),
        *_hears(*heard, keys.link(name) if role == "device" else keys.grant),
        _allow("ingress", ["liveliness_query", "declare_liveliness_subscriber"], hub),
        _allow("egress", ["liveliness_token"], hub),
    ]


def _feed(plan: Plan, keys: Keys, outlet: ConnectionToDevice) -> str:
    """Return the key on which a device gets what a connection brings."""
    if plan.participants[outlet.source].port(outlet.source_port).variability == "event":
        return keys.feed(outlet.source, outlet.source_port)
    return keys.signals(outlet.source, outlet.target)


def _asks(*keys: str) -> list[Rule]:
    return [_allow("ingress", ["query"], *keys), _allow("egress", ["reply", "declare_queryable"], *keys)]


def _hears(*keys: str) -> list[Rule]:
    return [_allow("ingress", ["declare_subscriber"], *keys), _allow("egress", ["put"], *keys)]


def _allow(flow: str, messages: Sequence[str], *keys: str) -> Rule:
    flows = ["ingress", "egress"] if flow == "both" else [flow]
    return {"permission": "allow", "flows": flows, "messages": list(messages), "key_exprs": list(keys)}
