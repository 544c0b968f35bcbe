"""A process' share of a session: steps the process' participants in order and publishes their outputs.

The host does not know whether a value comes from a neighbour in this process or from another process: both
are cells.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from math import isfinite
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numpy as np

from hub.hosting.host_layout import HostLayout, Listeners
from hub.hosting.hosted_participant import HostedParticipant
from hub.hosting.leap import Leap, find_leap
from hub.participant import Outputs, Setup, Stepped
from hub.planning.plan import Plan, PlannedParticipant
from hub.planning.session_parameters import Successors
from hub.transport.cells import INITIAL
from hub.transport.envelope import Tag
from hub.transport.host_link import IDLE
from hub.transport.port_codec import PortCodec
from hub.transport.reader import Queue, Reader
from hub.transport.wire import Wire
from schemas.errors import MessageError, ParticipantError, TrocarError
from schemas.lockstep import Ack, Entering, Grant
from schemas.ports import BondSide
from schemas.trocar_msgs import InletSample

__all__ = ["Done", "Host"]

log = logging.getLogger(__name__)

Done = Callable[[PlannedParticipant, Ack], None]
"""Is called with the ack of a participant after the participant's last step of a grant."""


class Host:
    """The stepped participants of a process.

    Args:
        name: The host's name in the plan.
        plan: The plan of the session.
        participants: The host's participants by name, not yet configured.
        wire: Carries values to and from other processes; None without any.
        listeners: Returns the listeners for the values of outputs; None without listeners.
        place: A single element, the place of the participant being stepped by `run`; IDLE afterwards.
        successors: Successors of participants, each with the first step.
    """

    def __init__(
        self,
        name: str,
        plan: Plan,
        participants: Mapping[str, Stepped],
        *,
        wire: Wire | None = None,
        listeners: Listeners | None = None,
        place: memoryview[int] | None = None,
        successors: Successors | None = None,
    ) -> None:
        self.name = name
        self.plan = plan
        self._step_s = plan.step_ns / 1e9
        self._wire = wire
        layout = HostLayout(name, plan, participants, wire, listeners)
        self._hosted = layout.participants
        self._remote_cells = layout.remote_cells
        self._seldom_read = layout.seldom_read
        self._inlets = layout.inlets
        self.device_inputs = layout.device_inputs
        """The inputs of the devices in simulated time here."""
        self.step = INITIAL
        """The present or last step of the host."""
        self._noted = -1  # of the wire's changes
        self._place: memoryview[int] | list[int] = [IDLE] if place is None else place
        given = successors or {}
        self._successors = sorted(
            ((step, one, new) for one in self._hosted for step, new in given.get(one.name, ())),
            key=lambda renewal: renewal[0],
        )
        """Handovers still to come: the step, the hosted participant, and the successor."""

    @property
    def participants(self) -> Sequence[PlannedParticipant]:
        """The participants of this host, in step order."""
        return [one.planned for one in self._hosted]

    @property
    def awaited(self) -> str | None:
        """The participant awaited by `run`: during a step here, or for a value from another process."""
        waiting = (source for (source, _), cell in self._remote_cells.items() if cell.waiting)
        place = self._place[0]
        return next(waiting, None if place == IDLE else self._hosted[place].name)

    @property
    def ended(self) -> dict[str, str]:
        """The participants ending the session, with the reasons."""
        return {one.name: reason for one in self._hosted if (reason := one.participant.ended)}

    def configure(self, directory: Path) -> dict[str, tuple[BondSide, ...]]:
        """Configure every participant and publish the outputs at time 0.

        Returns the bonds of each, with the numbers known now. Raises ParticipantError naming the failed
        participant.
        """
        bonds: dict[str, tuple[BondSide, ...]] = {}
        for one in self._hosted:
            setup = Setup(one.h_ns, directory, one.planned.bond_plans, self.plan.connected_inputs(one.name))
            last = one.participant
            try:
                self._publish(one, INITIAL, 0, one.participant.configure(setup))
                for _, its, new in self._successors:
                    if its is one:
                        new.configure(setup)
                        new.restore(one.participant.save())  # now rather than when all was simulated again
                        last = new
            except ParticipantError:
                raise
            except TrocarError as error:
                raise ParticipantError(one.name, INITIAL, str(error)) from error
            except Exception as error:
                log.exception("participant '%s' raised while it was configured", one.name)
                raise ParticipantError(one.name, INITIAL, f"{type(error).__name__}: {error}") from error
            bonds[one.name] = last.bonds
        return bonds

    def begin(self, outputs: Mapping[str, Outputs]) -> None:
        """Publish the outputs at time 0, by participant, of participants already configured."""
        for one in self._hosted:
            self._publish(one, INITIAL, 0, outputs[one.name])

    def newest(self, name: str) -> Outputs:
        """Return the last outputs of a participant; the next step may write to their arrays."""
        return next(one.newest for one in self._hosted if one.name == name)

    def publish_initial(self) -> None:
        """Publish the outputs at time 0 once more, for hosts not listening before."""
        for one in self._hosted:
            for _, outputs in one.outputs:
                outputs.put_initial_again()
            self._send_bundles(one, INITIAL, 0)

    def has_initial_values(self) -> bool:
        """Return whether all values of remote hosts at time 0, as far as needed here, have arrived."""
        return self._wire is None or self._wire.has_initial_values()

    def due(self, step: int, count: int) -> list[str]:
        """Return the participants with at least a step in `count` steps from `step`, in step order."""
        return [one.planned.name for one in self._hosted if -step % one.planned.period < count]

    def run(self, grant: Grant, done: Done) -> None:
        """Enter the samples of `grant` and step to the horizon of the grant.

        `done` is called with the ack of each participant directly after the participant's last step. Raises
        ParticipantError.
        """
        while self._successors and self._successors[0][0] <= grant.step:
            self._renew_participant(*self._successors.pop(0))
        self._enter_samples(grant)
        step_ns = self.plan.step_ns
        end = grant.horizon_ns // step_ns
        for one in self._hosted:
            one.hashes, one.compute_ns, one.work_j = [], [], []
        for step in range(grant.step, end):
            self.step = step
            self._note_users()
            for place, one in enumerate(self._hosted):
                period = one.period
                if step % period:
                    continue
                self._place[0] = place
                self._step(one, step, step * step_ns)
                if step + period >= end:
                    report = one.hashes, one.compute_ns, one.work_j
                    done(one.planned, Ack(grant.run, grant.epoch, grant.step, *report))
        self._place[0] = IDLE
        for cell, readers in self._seldom_read:
            cell.take_until(
                min(cell.tag(-(-end // period) * period, fresh=fresh) for period, fresh in readers)
            )

    @cached_property
    def _leap(self) -> Leap | None:
        return find_leap(self._hosted, self.plan)

    @property
    def leaps(self) -> bool:
        """Whether `leap` is possible: participants and connections allow several steps at once."""
        return self._leap is not None

    def leap(self, grant: Grant) -> None:
        """Enter the samples of `grant` and go to the horizon of the grant, by leaps, without state hashes.

        Raises ParticipantError.
        """
        if self._leap is None:
            raise ValueError(f"host '{self.name}' has participants that only go step by step")
        self._enter_samples(grant)
        self._note_users()
        end = grant.horizon_ns // self.plan.step_ns
        try:
            self._leap.run(grant.step, end, self._publish, self._step)
        except ParticipantError:
            raise
        except TrocarError as error:
            raise ParticipantError(self._leap.present, grant.step, str(error)) from error
        self.step = end - 1

    def _enter_samples(self, grant: Grant) -> None:
        for sample in grant.inlets:
            for one, port, codec in self._inlets.get((sample.participant, sample.port), ()):
                _enter(one, port, codec, sample)

    def _renew_participant(self, step: int, one: HostedParticipant, new: Stepped) -> None:
        """Let `new` go on in the place of a participant, with the participant's state."""
        try:
            new.restore(one.participant.save())
        except TrocarError as error:
            raise ParticipantError(one.name, step, f"cannot take other parameters: {error}") from error
        starts = {port.name: port.start for port in one.participant.ports}
        connected = self.plan.connected_inputs(one.name)
        for port in new.ports:
            if port.start not in (None, starts[port.name]) and port.name not in connected:
                one.values[port.name] = np.array(port.start, np.float64)
        new.unread = one.participant.unread
        one.participant.close()
        one.participant = new

    def _note_users(self) -> None:
        """Note the unused outputs of the participants, if the use may have changed."""
        changes = 0 if self._wire is None else self._wire.changes
        if changes == self._noted:
            return
        self._noted = changes
        if self._wire is not None:
            self._wire.noted = changes
        for one in self._hosted:
            one.participant.unread = frozenset(o.port.name for o in one.ports if not o.is_used)

    def _step(self, one: HostedParticipant, step: int, t: int) -> None:
        name = one.name
        for reader in one.readers:
            if isinstance(reader, Reader):
                self._read(one, reader, step)
            elif reader.arrived:
                _move_messages(one, reader)
        begun = perf_counter_ns()
        try:
            outputs = one.participant.step(t, one.h_ns, one.inputs)
            one.compute_ns.append(perf_counter_ns() - begun)
            self._publish(one, step, t + one.h_ns, outputs)  # before the hash: another host may wait for it
            one.hashes.append(one.participant.state_hash())
            for port in one.work_ports:
                work = float(outputs[port][0])  # pyright: ignore[reportArgumentType, reportIndexIssue]
                if not isfinite(work):
                    raise ParticipantError(name, step, f"output '{port}' is not finite: {work}")
                one.work_j.append(work)
        except ParticipantError:
            raise
        except TrocarError as error:
            raise ParticipantError(name, step, str(error)) from error
        except Exception as error:
            log.exception("participant '%s' raised in step %d", name, step)
            raise ParticipantError(name, step, f"{type(error).__name__}: {error}") from error
        if one.events:
            one.events.clear()

    def _read(self, one: HostedParticipant, reader: Reader, step: int) -> None:
        cell = reader.cell
        if reader.messages is not None:
            if arrived := reader.events(step, self.plan.step_ns):
                messages = (message for _, message in arrived)
                one.events[reader.port] = (*one.events.get(reader.port, ()), *messages)
            return
        tag = cell.tag(step, fresh=reader.fresh)
        value = cell.get(tag)
        if reader.linear:
            rate = one.rates[reader.port] = (value - cell.get(cell.before(tag))) / reader.stride_s
            value = value + rate * ((step - cell.valid_from(tag)) * self._step_s)
        one.values[reader.port] = value

    def _publish(self, one: HostedParticipant, step: int, time_ns: int, returned: Outputs) -> None:
        """Check the outputs due, and pass the values on to readers here and elsewhere."""
        one.newest = returned
        for stride, outputs in one.outputs:
            if step == INITIAL or not (step + one.period) % stride:
                outputs.put(step, time_ns, returned)
        if one.bundles:
            self._send_bundles(one, step, time_ns)
        if self._wire is not None:
            self._wire.flush()

    def _send_bundles(self, one: HostedParticipant, step: int, time_ns: int) -> None:
        if self._wire is not None:
            for bundle in one.bundles.values():
                if bundle.filled:
                    bundle.send(Tag.pack(self._wire.run.number, 0, step, time_ns), first=step == INITIAL)

    def observe(self, name: str, time_ns: int, values: Mapping[str, Any]) -> None:
        """Step an observer from the communication point `time_ns` with `values` as inputs.

        Raises ParticipantError.
        """
        one = next(one for one in self._hosted if one.name == name)
        one.values.update(values)
        one.hashes.clear()
        one.compute_ns.clear()
        self.step = time_ns // self.plan.step_ns
        self._note_users()
        self._step(one, self.step, time_ns)

    def close(self) -> None:
        """Close every participant, the last first; an error in one does not keep the others open."""
        every = [(one.name, one.participant) for one in self._hosted]
        every += [(one.name, new) for _, one, new in self._successors]
        for name, participant in reversed(every):
            try:
                participant.close()
            except Exception:
                log.exception("participant '%s' raised while it was closed", name)
        if self._wire is not None:
            self._wire.close()


def _move_messages(one: HostedParticipant, queue: Queue) -> None:
    """Move the messages in a queue to the inputs of a participant."""
    one.events[queue.port] = (*one.events.get(queue.port, ()), *queue.arrived)
    queue.arrived.clear()


def _enter(one: HostedParticipant, port: str, codec: PortCodec, sample: InletSample | Entering) -> None:
    """Write an inlet sample of a grant into the inputs of a participant."""
    if sample.stale:
        one.stale.add(port)
    else:
        one.stale.discard(port)
    if not sample.payload.size:
        return
    decoded = sample.decoded if isinstance(sample, Entering) else None
    if decoded is not None and decoded[0] == codec.layout:
        value = decoded[1]
    else:
        try:
            value = codec.accept(sample.payload.tobytes())
        except MessageError as error:
            log.warning("inlet sample for '%s.%s' refused: %s", one.name, port, error)
            return
    if codec.is_event:
        one.events[port] = (*one.events.get(port, ()), value)
    else:
        one.values[port] = value
