"""Connections with a wildcard: `motion.drive/* -> robot.*` spelt out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from schemas.errors import ScenarioError, did_you_mean
from schemas.ports import Port
from schemas.scenario import Connection

__all__ = ["spelt_out"]


def spelt_out(
    connection: Connection, ports: Mapping[str, Sequence[Port]], path: tuple[str | int, ...]
) -> tuple[Connection, ...]:
    """Return the single connections that `connection`, which stands at `path` in the scenario, means among
    the `ports` of each participant.

    Raises ScenarioError if a wildcard joins nothing.
    """
    one, other = connection.source, connection.target
    if not connection.is_wildcard:
        return (connection,)
    for name in (one.participant, other.participant):
        if name not in ports:
            raise ScenarioError(f"unknown participant '{name}'.{did_you_mean(name, ports)}", path=path)
    outputs = [port.name for port in ports[one.participant] if port.causality == "output"]
    inputs = [port.name for port in ports[other.participant] if port.causality == "input"]
    here, there = one.port.removesuffix("*"), other.port.removesuffix("*")
    pairs = [(name, there + name.removeprefix(here)) for name in outputs if name.startswith(here)]
    joined = [
        connection.model_copy(
            update={
                "source": one.model_copy(update={"port": source}),
                "target": other.model_copy(update={"port": target}),
            }
        )
        for source, target in pairs
        if target in inputs
    ]
    if not joined:
        lists = (
            f"outputs of '{one.participant}': {', '.join(outputs) or 'none'}; inputs of"
            f" '{other.participant}': {', '.join(inputs) or 'none'}"
        )
        raise ScenarioError(f"'{one} -> {other}' joins nothing ({lists})", path=path)
    return tuple(joined)
