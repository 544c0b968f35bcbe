"""Ports of the routine of the whole operation: those of its parts, the exchange of instruments, progress."""

from __future__ import annotations

from collections.abc import Sequence

from controllers.operation.params import OperationParams
from hub.participant import Stepped, event_out, signal_in, signal_out
from schemas.ports import Port
from schemas.ros import Float64Message, StringMessage

__all__ = ["PHASES", "PROGRESS", "operation_ports"]

PHASES = ("calot triangle", "clipping and cutting", "gallbladder bed")
"""Names of the phases, in order."""
PROGRESS = {
    "phase": ", ".join(f"{number} {name}" for number, name in enumerate(PHASES)),
    "total": "how often something was tried again, in all phases so far",
    "done": "1 when all phases are over",
    "failed": "1 when a routine has given up; `status` says why",
}


def operation_ports(params: OperationParams, parts: Sequence[Stepped]) -> tuple[Port, ...]:
    """Return the ports. Progress of single routines is not among them."""
    found: dict[str, Port] = {}
    for part in parts:
        for port in part.ports:
            name = port.name
            if port.causality == "output" and "/" not in name:
                continue
            if name not in found or found[name].start == ():
                found[name] = port
    own = (
        signal_in(f"{params.hook}/instrument", Float64Message, "number of the instrument in the arm"),
        event_out(f"{params.hook}/set_tool_type", StringMessage, "asks for the next instrument"),
        *(signal_out(name, Float64Message, meaning) for name, meaning in PROGRESS.items()),
        event_out("instruction", StringMessage, "the sub-task of clipping and cutting that begins"),
        event_out("status", StringMessage, "what begins, what is tried again, and why it has given up"),
    )
    return (*found.values(), *own)
