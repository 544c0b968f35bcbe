"""Time use of a process of a session: the stepping thread by phases, all further threads by purpose."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from hub.hosting.host import Host
from hub.observation.stopwatch import Phase, Stopwatch
from hub.observation.thread_clocks import ThreadClocks
from hub.participant import Stepped
from hub.planning.plan import Plan, PlannedParticipant
from hub.transport.cells import RemoteCell
from hub.transport.wire import Wire
from schemas.trocar_msgs import ProfileRow

__all__ = ["WAITING", "ProcessProfile"]

WAITING = "waiting"
"""Name of the time a core is kept busy while a thread waits."""

_CONNECTIONS = "connections"


class ProcessProfile:
    """Times the stepping thread of a host, and sums the others.

    Args:
        host: The host.
        plan: The plan of the session.
        between: The phase of the stepping thread outside `Host.run`.
    """

    def __init__(self, host: str, plan: Plan, between: Phase) -> None:
        self._host = host
        self.watch = Stopwatch(between)
        mine = [planned for planned in plan.participants.values() if planned.host == host]
        devices = [planned.name for planned in mine if planned.role == "device"]
        stepped = [planned.name for planned in mine if planned.role != "device"]
        of_devices = f"device {', '.join(devices)}" if devices else "other threads"
        # pictures are drawn in threads of their own
        native = f"threads of {', '.join(stepped)}" if stepped else of_devices
        self._clocks = ThreadClocks(lambda name: _taker(name, host, of_devices), native)

    def prepare(self, stepped: Mapping[str, Stepped], wire: Wire) -> None:
        """Time participants and the receivers of `wire`; call this before making a Host."""
        inputs = self.watch.phase("inputs", _CONNECTIONS)
        outputs = self.watch.phase("outputs", _CONNECTIONS)
        hashes = self.watch.phase("state hashes", "state hashes")
        for name, participant in stepped.items():
            taker = f"participant {name}"
            self.watch.time(participant.step, self.watch.phase(taker, taker), then=outputs)
            self.watch.time(participant.state_hash, hashes, then=inputs)
        make: Callable[..., RemoteCell] = wire.cell

        def cell(planned: PlannedParticipant, *arguments: Any) -> RemoteCell:
            made = make(planned, *arguments)
            self.watch.time(made.get, self.waiting_for([planned.host]))
            return made

        setattr(wire, "cell", cell)  # noqa: B010 - a method is replaced on its object

    def waiting_for(self, hosts: Iterable[str]) -> Phase:
        """Return the phase of waiting for messages of remote hosts."""
        return self.watch.phase(f"waiting for {', '.join(sorted(set(hosts)))}", WAITING)

    def attach(self, host: Host, ran: Callable[[], None] = lambda: None) -> None:
        """Time `Host.run` and `Host.observe`; `ran` is called after each."""
        inputs = self.watch.phase("inputs", _CONNECTIONS)

        def named(_: None) -> Phase:
            ran()
            return inputs

        for method in (host.run, host.observe):
            self.watch.time_by_result(method, inputs, named)

    def restart(self) -> None:
        """Count from now; the calling thread is the stepping thread and the main thread."""
        self._clocks.restart()
        self.watch.restart()

    def rows(self) -> list[ProfileRow]:
        """Return the time of each phase and of all further threads so far; from any thread.

        The phases share the processor time of the main thread in the proportions of the sampled rounds, or
        in the proportions of the wall time without sampled rounds.
        """
        phases = [phase for phase in list(self.watch.phases.values()) if phase.wall_ns]
        weights = {phase: phase.sampled_ns for phase in phases}
        if not any(weights.values()):
            weights = {phase: phase.wall_ns for phase in phases}
        main_ns = self._clocks.main_ns()
        share = main_ns / max(sum(weights.values()), 1)
        stepping = [
            ProfileRow(
                host=self._host,
                taker=phase.taker,
                phase=phase.name,
                wall_s=phase.wall_ns / 1e9,
                core_s=weights[phase] * share / 1e9,
            )
            for phase in phases
        ]
        others = self._clocks.other_ns(main_ns)
        return stepping + [
            ProfileRow(host=self._host, taker=taker, core_s=time_ns / 1e9)
            for taker, time_ns in sorted(others.items())
        ]


def _taker(thread: str, host: str, of_devices: str) -> str:
    """Return the purpose of a thread of Python."""
    if thread == "recorder" or thread.startswith("device "):
        return thread
    return "hub" if host == "hub" else of_devices
