"""Use of energy: time with power, and power without contact or on another instrument."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hub.participant import Record, array
from schemas.trocar_msgs import ScoreValue
from tasks.cholecystectomy.tissue_seen import TissueSeen
from tasks.cholecystectomy.watch import Watch, value_or_reason
from tasks.events import Event
from tasks.instant import Instant

__all__ = ["Energy"]

_BESIDE = 12e-3
"""Distance of the tips of two arms within which idle power is on the other instrument, m; ours."""
_HEAT_STEP = 0.02
"""Time that tissue may take to report heat, s."""


class EnergyState(Record):
    """Sums of each arm."""

    on = array("arms")
    """Time with power, s."""
    idle = array("arms")
    """Time with power that heats nothing, s."""
    idle_energy = array("arms")
    """Energy of that time, J."""
    delivered = array("arms")
    """Heat given to tissue at the last instant, J."""
    activations = array("arms")
    was_on = array("arms")
    spell = array("arms")
    """Length of the present time of idle power, s."""
    impulse = array(1)
    """Impulse between instruments at the last instant, N s."""
    blind = array("arms")
    """Number of activations in the air or on an instrument."""


class Energy(Watch[EnergyState]):
    """Activations, times and idle energy of each arm; also makes the events about idle power."""

    def __init__(self, seen: TissueSeen, longest: float) -> None:
        """`longest`: time of idle power that is no error, s."""
        self.state = EnergyState(arms=len(seen.arms))
        self._seen, self._longest = seen, longest

    def observe(self, now: Instant) -> Iterator[Event]:
        """Add a period; yield the events of an instant."""
        state = self.state
        for i, arm in enumerate(self._seen.arms):
            is_on, gain = arm.power > 0.0, arm.delivered - float(state.delivered[i])
            state.delivered[i] = arm.delivered
            state.activations[i] += is_on and not state.was_on[i]
            state.was_on[i] = is_on
            if not (is_on and arm.has_energy):
                state.spell[i] = 0.0
                continue
            state.on[i] += now.period_s
            if gain > 0.0:
                state.spell[i] = 0.0
                continue
            before = float(state.spell[i])
            state.spell[i] += now.period_s
            if state.spell[i] <= _HEAT_STEP:
                continue
            idle = now.period_s if before > _HEAT_STEP else float(state.spell[i])
            state.idle[i] += idle
            state.idle_energy[i] += arm.power * idle
            if before < self._longest <= state.spell[i]:
                state.blind[i] += 1.0
                kind = "energy on an instrument" if self._meets(i, now) else "energy in the air"
                yield Event(kind, arm=i, value=arm.power, unit="W")
        state.impulse[0] = now.impulse

    def _meets(self, arm: int, now: Instant) -> bool:
        """Return whether an arm's instrument is on another one."""
        if now.impulse > self.state.impulse[0]:
            return True
        apart = np.linalg.norm(np.delete(now.tips, arm, axis=0) - now.tips[arm], axis=1)
        return bool(apart.size and apart.min() < _BESIDE)

    def values(self) -> Iterator[ScoreValue]:
        """Yield counts, times (s) and energies (J) of each arm."""
        rows = (
            ("activations", self.state.activations, ""),
            ("blind_activations", self.state.blind, ""),
            ("energy_time", self.state.on, "s"),
            ("idle_energy_time", self.state.idle, "s"),
            ("idle_energy", self.state.idle_energy, "J"),
            ("heat", self.state.delivered, "J"),
        )
        for name, values, unit in rows:
            for arm, value in zip(self._seen.arms, values.tolist(), strict=True):
                full = f"{arm.name}/{name}"
                reason = (
                    f"no energy: connect or record {arm.name}/energy and tissue/{arm.name}/delivered of a"
                    " probe with energy"
                )
                yield value_or_reason(full, value, unit, "" if arm.has_energy else reason)
