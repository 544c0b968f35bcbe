"""The command of a sucker or an irrigator: a share of the most flow."""

from __future__ import annotations

from hub.participant import Inputs, signal_in
from schemas.ports import Port

__all__ = ["commanded_share", "flow_port"]

_MOST_AGE_NS = 200_000_000
"""Age at which a command of a silent device is none."""


def flow_port(name: str, what: str) -> Port:
    """Return the port of a command. `what`: suction or irrigation."""
    return signal_in(
        name,
        description=f"share of the most {what}, from 0 to 1; 0 from a silent device",
        start=(0.0,),
        max_age_ns=_MOST_AGE_NS,
    )


def commanded_share(inputs: Inputs, name: str) -> float:
    """Return the share that is commanded now, 0 to 1."""
    command = 0.0 if inputs.stale(name) else inputs.number(name, 0.0)
    return min(command, 1.0) if command > 0.0 else 0.0  # 0 of NaN
