"""The tunable parameters of a participant: numbers that people change while the session runs.

    gravity = tunable_in("gravity", 9.81, (0.0, 25.0), "along -z of the world", unit="m/s^2")

    tunables = Tunables(self.ports)                  # in configure
    for name, value in tunables.changes(inputs):     # in each step
        self._apply(name, value)

A change enters with a grant, as all else that enters a simulation, so it is recorded and simulated again at
the same step: docs/decisions/0119-parameters-that-change.md.
"""

from __future__ import annotations

from collections.abc import Iterable

from hub.participant.inputs import Inputs
from schemas.ports import Port

__all__ = ["Tunables"]


class Tunables:
    """The values in effect, and the changes of a step."""

    def __init__(self, ports: Iterable[Port]) -> None:
        tunable = [port for port in ports if port.limits is not None and port.start is not None]
        self._values = {port.name: port.start[0] for port in tunable if port.start}
        self._limits = {port.name: port.limits for port in tunable if port.limits}

    def changes(self, inputs: Inputs) -> list[tuple[str, float]]:
        """Return name and new value of each changed parameter, and take the values as in effect.

        A value outside the limits, which only a connection can bring, changes nothing.
        """
        found: list[tuple[str, float]] = []
        for name, value in self._values.items():
            wanted = inputs.number(name, value)
            least, most = self._limits[name]
            if wanted != value and least <= wanted <= most:
                found.append((name, wanted))
        self._values.update(found)
        return found
