"""Several steps of a host at once, for participants that can: the same bits, without hashes of states.

A leap ends with the first step in which a participant of a longer period is due, so every participant sees
what it sees step by step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, cast

from hub.hosting.hosted_participant import HostedParticipant
from hub.participant import Leaper, Outputs
from hub.planning.plan import Plan
from schemas.vectors import Vector

__all__ = ["Leap", "find_leap"]

Publish = Callable[[HostedParticipant, int, int, Outputs], None]
"""Publishes the outputs of a participant after a step."""
Step = Callable[[HostedParticipant, int, int], None]
"""Takes a step of a participant."""


class _Leaping(NamedTuple):
    """A participant that leaps."""

    one: HostedParticipant
    leaper: Leaper
    sources: Sequence[tuple[str, str, str]]
    """Input, and the leaping participant and output that feed the input in every step."""


class Leap:
    """The leaping participants of a host, and the others with longer periods.

    Args:
        leaping: Participants with a step in every communication step, in step order.
        seldom: Participants with longer periods; they step after the leaping ones.
        step_ns: Communication step.
    """

    def __init__(
        self, leaping: Sequence[_Leaping], seldom: Sequence[HostedParticipant], step_ns: int
    ) -> None:
        self._leaping, self._seldom, self._step_ns = leaping, seldom, step_ns
        self.present = ""
        """The participant that leaps now, or did last."""

    def run(self, step: int, end: int, publish: Publish, take_step: Step) -> None:
        """Take the steps from `step` until `end`."""
        while step < end:
            due = min((step + -step % one.period for one in self._seldom), default=end)
            stop = min(end, due + 1)
            self._run(step, stop - step, publish, take_step)
            step = stop

    def _run(self, step: int, count: int, publish: Publish, take_step: Step) -> None:
        made: dict[tuple[str, str], Vector] = {}
        last, t = step + count - 1, step * self._step_ns
        for one, leaper, sources in self._leaping:
            self.present = one.name
            given = {port: made[source, output] for port, source, output in sources}
            outputs, series = leaper.leap(t, one.h_ns, count, one.inputs, given)
            made |= {(one.name, output): values for output, values in series.items()}
            publish(one, last, last * self._step_ns + one.h_ns, outputs)
            one.events.clear()
        for one in self._seldom:
            if not last % one.period:
                one.hashes, one.compute_ns, one.work_j = [], [], []
                take_step(one, last, last * self._step_ns)


def find_leap(hosted: Sequence[HostedParticipant], plan: Plan) -> Leap | None:
    """Return how a host's participants leap; None if a connection or a participant does not allow it."""
    stepped = [one for one in hosted if not one.planned.observer]
    leaping = [one for one in stepped if isinstance(one.participant, Leaper)]
    seldom = [one for one in stepped if one not in leaping]
    names = {one.name for one in leaping}
    order = [one.name for one in stepped]
    for one in leaping:
        if one.period != 1 or any(stride != 1 for stride, _ in one.outputs) or one.work_ports:
            return None
    if any(one.period == 1 for one in seldom) or order[: len(leaping)] != [one.name for one in leaping]:
        return None
    sources: Mapping[str, list[tuple[str, str, str]]] = {name: [] for name in names}
    for connection in plan.connections:
        if connection.target not in names:
            continue
        before = order.index(connection.source) < order.index(connection.target)
        if connection.source not in names or not (before and connection.fresh) or connection.linear:
            return None
        sources[connection.target].append((connection.target_port, connection.source, connection.source_port))
    return Leap(
        [_Leaping(one, cast("Leaper", one.participant), sources[one.name]) for one in leaping],
        seldom,
        plan.step_ns,
    )
