"""Whether an output port fits an input port."""

from __future__ import annotations

from schemas.ports import Port
from schemas.quantity import same_unit
from schemas.scenario import PortReference
from schemas.vectors import VectorCodec, has_vector

__all__ = ["describe_misfit"]


def describe_misfit(one: PortReference, source: Port, other: PortReference, target: Port) -> str | None:
    """Return why output `source` at `one` does not fit input `target` at `other`; None if both fit."""
    if source.type != target.type:
        return f"'{one}' gives {source.type}, '{other}' takes {target.type}"
    if (source.variability, target.variability) == ("event", "signal"):
        return f"'{one}' gives events, '{other}' takes a signal, which has a value at all times"
    if not same_unit(source.unit, target.unit):
        return f"'{one}' is in '{source.unit}', '{other}' takes '{target.unit}'"
    if source.frame and target.frame and source.frame != target.frame:
        return f"'{one}' is in frame '{source.frame}', '{other}' takes frame '{target.frame}'"
    if has_vector(source.type) and source.variability == "signal":
        size, expected = VectorCodec(source).size, VectorCodec(target).size
        if size != expected and target.variability == "signal":
            return f"'{one}' has {size} numbers, '{other}' takes {expected}"
        if source.names and target.names and source.names != target.names:
            return f"'{one}' names {', '.join(source.names)}; '{other}' takes {', '.join(target.names)}"
    return None
