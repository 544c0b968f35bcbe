"""The tunable parameters of a running session, with their present values, for sliders on pages."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hub.planning.plan import Plan
from hub.transport.control_messages import SetRequest
from schemas.errors import MessageError, did_you_mean
from schemas.ports import Port
from webconsole.commands import Tune

__all__ = ["TunableParameters"]


class TunableParameters:
    """The unconnected inputs with limits, by `participant.port`."""

    def __init__(self, plan: Plan | None = None, changed: Mapping[str, float] | None = None) -> None:
        """`changed`: values other than at the start."""
        self._ports = {} if plan is None else _tunable_ports(plan)
        starts = {name: port.start[0] for name, (_, port) in self._ports.items() if port.start}
        self._values = starts | {
            name: value for name, value in (changed or {}).items() if name in self._ports
        }

    def request(self, order: Tune) -> SetRequest:
        """Return the request to the hub; raises MessageError for an unknown parameter or a wrong value."""
        if order.name not in self._ports:
            raise MessageError(
                f"'{order.name:.80}' is no parameter that may change while the session"
                f" runs.{did_you_mean(order.name, self._ports)}"
            )
        participant, port = self._ports[order.name]
        port.check_limits(order.value)
        return SetRequest(participant=participant, port=port.name, value=[order.value])

    def change_value(self, order: Tune) -> str:
        """Take a value that the hub has accepted; return the change as words."""
        before, self._values[order.name] = self._values[order.name], order.value
        _, port = self._ports[order.name]
        return f"{port.name}: {before:.4g} to {order.value:.4g} {port.unit}".rstrip()

    def as_json(self) -> list[dict[str, Any]]:
        """Return the parameters, ready for JSON."""
        return [
            {
                "name": name,
                "participant": participant,
                "port": port.name,
                "unit": port.unit,
                "limits": port.limits,
                "start": port.start and port.start[0],
                "value": self._values[name],
                "text": port.description,
            }
            for name, (participant, port) in self._ports.items()
        ]


def _tunable_ports(plan: Plan) -> dict[str, tuple[str, Port]]:
    return {
        f"{name}.{port.name}": (name, port)
        for name in plan.order
        for port in plan.participants[name].ports
        if port.limits is not None and port.name not in plan.connected_inputs(name)
    }
