"""Connections with a wildcard, such as `motion.drive/* -> robot.*`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import Port
from schemas.scenario import Connection

__all__ = ["expand_wildcard"]


def expand_wildcard(
    connection: Connection, ports: Mapping[str, Sequence[Port]], path: tuple[str | int, ...]
) -> tuple[Connection, ...]:
    """Return the single connections of `connection`, a connection with wildcards at `path` in the scenario.

    `ports` are the ports of every participant. Raises ScenarioError if a wildcard connects nothing.
    """
    one, other = connection.source, connection.target
    if not connection.is_wildcard:
        return (connection,)
    for name in (one.participant, other.participant):
        if name not in ports:
            raise ScenarioError(f"unknown participant '{name}'.{did_you_mean(name, ports)}", path=path)
    outputs = [port.name for port in ports[one.participant] if port.causality == "output"]
    inputs = [port.name for port in ports[other.participant] if port.causality == "input"]
    prefix, other_prefix = one.port.removesuffix("*"), other.port.removesuffix("*")
    pairs = [(name, other_prefix + name.removeprefix(prefix)) for name in outputs if name.startswith(prefix)]
    known = set(inputs)
    connections = [
        connection.model_copy(
            update={
                "source": one.model_copy(update={"port": source}),
                "target": other.model_copy(update={"port": target}),
            }
        )
        for source, target in pairs
        if target in known
    ]
    if not connections:
        names = f"outputs of '{one.participant}': {', '.join(outputs) or 'none'}"
        names += f"; inputs of '{other.participant}': {', '.join(inputs) or 'none'}"
        raise ScenarioError(f"'{one} -> {other}' connects nothing ({names})", path=path)
    return tuple(connections)
