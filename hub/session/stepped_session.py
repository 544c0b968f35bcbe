"""A session stepped by the caller: all participants in this process, without a hub, a wire or a clock.

For learning environments and optimisers: plan, host, grants and state hashes are the same as in any session,
and recordings verify; but the caller says how far to go, and begins again at time 0 any number of times, from
the participants' saved states.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self, cast

import numpy as np
from pydantic import ValidationError

from hub.hosting.host import Host
from hub.observation.measures import Measures
from hub.observation.monitor import Monitor
from hub.participant import Inputs, Outputs, Setup, Stepped, Value
from hub.planning.plan import Plan, PlannedParticipant
from hub.planning.scenario_file import ScenarioFile
from hub.recording.recorder import Recorder
from hub.session.clock import most_steps
from hub.session.launch import attachments_of, in_one_host, plan_of
from hub.session.reading import Reading
from hub.session.state_digests import StateDigests
from hub.transport.port_codec import PortCodec
from schemas.errors import ScenarioError, SessionError, StateError, did_you_mean
from schemas.files import Files
from schemas.keys import Keys
from schemas.lockstep import Ack, Entering, Grant, pack_grant
from schemas.trocar_msgs import SessionStatus
from schemas.vectors import Vector, VectorCodec

__all__ = ["SteppedSession"]

_RUN = 1
"""Number of the run: no message of another run can arrive here."""


class SteppedSession:
    """The participants of a scenario, stepped by the caller. Scenarios with devices are refused.

        with trocar.SteppedSession(trocar.load_scenario("pick.yaml")) as session:
            session.advance(100)                                            # steps
            session["robot.needle/pose"]                                    # (7,), m
            session.read("robot.PSM1/measured_js")["position.insertion"]    # m

    A new session stands at time 0. Observers in pace `realtime` are not stepped with the others; `look` steps
    an observer.

    Raises:
        ScenarioError: The scenario has devices, or is invalid.
        ParticipantError: A participant cannot be configured.
    """

    def __init__(self, loaded: ScenarioFile) -> None:
        self._loaded, self._params = loaded, dict(loaded.params)
        # it ends where its caller ends it, in a re-simulation too
        self._scenario = in_one_host(loaded.scenario).model_copy(update={"duration": None})
        self.plan: Plan
        self.plan, self._stepped = self._make_participants()
        self._window = most_steps(self.plan, self._scenario.window)
        self._codecs = self._inlets()
        self._recorder: Recorder | None = None
        self._looking: set[str] = set()
        self._readable: dict[str, VectorCodec] = {}
        self._host = Host("hub", self.plan, self._stepped)
        self._configure_all()

    def _make_participants(self) -> tuple[Plan, dict[str, Stepped]]:
        plan, made = plan_of(self._scenario, self._params)
        stepped = {name: one for name, one in made.items() if isinstance(one, Stepped)}
        if devices := sorted(made.keys() - stepped.keys()):
            raise ScenarioError(
                f"a stepped session has no devices, and the scenario has {', '.join(devices)}: leave them"
                " out, and give their values to `advance`, as inputs of the participants that they led"
            )
        return plan, stepped

    def _inlets(self) -> dict[str, PortCodec]:
        """Return the unconnected inputs, as `participant.port`."""
        return {
            f"{name}.{port.name}": PortCodec(port)
            for name in self.plan.order
            for port in self.plan.participants[name].ports
            if port.causality == "input" and port.name not in self.plan.connected_inputs(name)
        }

    def _configure_all(self) -> None:
        """Configure all participants, and keep the initial states for `restart`."""
        self._host.configure(self._loaded.source.directory)
        self._first = {name: _copy_outputs(self._host.newest(name)) for name in self.plan.order}
        try:
            self._saved = {name: self._stepped[name].save() for name in self.plan.order}
        except StateError:
            self._saved = {}
        self._begin(None)

    def restart(self, record: str | Path | None = None) -> None:
        """Go back to time 0, from saved states or, if any participant cannot save states, all made anew.

        `record`: a new directory for a recording from here to the next `restart` or `close`. Raises
        RecordingError if the directory is not empty, or cannot be written.
        """
        self._end_recording()
        directory = None if record is None else Path(record)
        if self._saved:
            for name, state in self._saved.items():
                self._stepped[name].restore(state)
            self._begin(directory)
            return
        self.close()
        self.plan, self._stepped = self._make_participants()
        self._host = Host("hub", self.plan, self._stepped)
        self._configure_all()
        if directory is not None:
            self._begin(directory)

    def _begin(self, record: Path | None) -> None:
        """Connect the participants anew, and begin with their outputs at time 0."""
        self.step = 0
        """The number of communication steps taken."""
        self._digests, self._hashed = StateDigests(self.plan.order), True
        self._monitor: Monitor | None = None
        if record is not None:
            attachments = attachments_of(self._scenario, self.plan, self._loaded)
            self._recorder = Recorder(record, attachments=attachments)
            measures = Measures(self._scenario, self.plan)
            keys = Keys(self._scenario.name)
            self._monitor = Monitor(self.plan, keys, _RUN, measures, self._recorder)
        self._host = Host("hub", self.plan, self._stepped, listeners=self._monitor)
        self._host.begin(self._first)

    def advance(self, steps: int, inputs: Mapping[str, Value] | None = None) -> None:
        """Take `steps` communication steps.

        `inputs` enter before the first step, by `participant.port`: for a signal a value, for an event port a
        tuple of messages. Only inputs without a connection can be given; given inputs keep their values.

        Raises ParticipantError if a participant fails, SessionError for an input that cannot be given, and
        MessageError for a value that does not fit the port. After an error only `restart` goes on.
        """
        entering = self._entering(inputs)
        while steps:
            count = min(steps, self._window)
            self._send_grant(count, entering)
            steps, entering = steps - count, ()

    def leap(self, steps: int, inputs: Mapping[str, Value] | None = None) -> None:
        """Take `steps` communication steps as `advance` does, with the same bits, but without state hashes.

        Where participants allow several steps at once, only the last is observed. While a session is
        recorded, and where `leaps` is false, this is `advance`.
        """
        if self._monitor is not None or not self._host.leaps:
            self.advance(steps, inputs)
            return
        self._hashed = False
        end_ns = (self.step + steps) * self.plan.step_ns
        self._host.leap(Grant(_RUN, 0, self.step, self.time_ns, end_ns, self._entering(inputs)))
        self.step += steps

    @property
    def leaps(self) -> bool:
        """Whether `leap` takes several steps at once here."""
        return self._host.leaps

    def _entering(self, inputs: Mapping[str, Value] | None) -> tuple[Entering, ...]:
        return tuple(
            sample for port, value in (inputs or {}).items() for sample in self._samples(port, value)
        )

    def _samples(self, port: str, value: Value) -> list[Entering]:
        codec = self._codecs.get(port)
        if codec is None:
            raise SessionError(
                f"'{port}' is no input without a connection.{did_you_mean(port, self._codecs)}"
            )
        name, _, input_port = port.partition(".")
        if codec.port.limits is not None:
            codec.port.check_limits(np.asarray(value, np.float64).item())
        values = value if isinstance(value, tuple) else (value,)
        payloads = (codec.encode(one, self.time_ns) for one in values)
        return [
            Entering(name, input_port, False, np.frombuffer(payload, np.uint8), 0) for payload in payloads
        ]

    def _send_grant(self, count: int, entering: tuple[Entering, ...]) -> None:
        step_ns = self.plan.step_ns
        grant = Grant(_RUN, 0, self.step, self.time_ns, (self.step + count) * step_ns, entering)
        if self._monitor is not None:
            self._monitor.grant(grant, pack_grant(grant))
        self._host.run(grant, self._book_work)
        self.step += count
        if self._monitor is not None:
            self._monitor.due_energy_books(self.time_ns)
            self._monitor.record()

    def _book_work(self, planned: PlannedParticipant, ack: Ack) -> None:
        self._digests.add(planned.name, ack.state_hash)
        if self._monitor is not None:
            first = ack.step + -ack.step % planned.period
            end = first + len(ack.state_hash) * planned.period
            self._monitor.ack(planned, ack, end * self.plan.step_ns, None)

    @property
    def restores(self) -> bool:
        """Whether `restart` restores saved states; otherwise all participants are made anew."""
        return bool(self._saved)

    def participant(self, name: str) -> Stepped:
        """Return a participant, such as a task that knows its goals. Do not step the participant."""
        return self._stepped[name]

    @property
    def time_ns(self) -> int:
        """Simulated time."""
        return self.step * self.plan.step_ns

    @property
    def state_hash(self) -> str:
        """Hash of all state hashes since time 0, as in the summary of a session.

        Raises SessionError after a `leap`, which leaves hashes out.
        """
        if not self._hashed:
            raise SessionError("there is no state hash after a leap: go step by step, with `advance`")
        return self._digests.whole

    def __getitem__(self, port: str) -> Any:
        """Return the newest value of the output `participant.port`, an array safe to keep."""
        name, _, output = port.partition(".")
        if name not in self._stepped or output not in (newest := self._host.newest(name)):
            known = [f"{one}.{it}" for one in self.plan.order for it in self._host.newest(one)]
            raise SessionError(f"no output '{port}'.{did_you_mean(port, known)}")
        value = newest[output]
        return value.copy() if isinstance(value, np.ndarray) else value

    def read(self, port: str) -> Reading:
        """Return the newest value of the signal `participant.port`, with the names of its numbers.

        Raises SessionError if there is no such output, or if its values are messages: `session[port]`.
        """
        values = self[port]
        if not isinstance(values, np.ndarray):
            raise SessionError(f"'{port}' has messages, without names of numbers: use session[port]")
        if (codec := self._readable.get(port)) is None:
            name, _, output = port.partition(".")
            declared = self.plan.participants[name].port(output)
            codec = self._readable[port] = VectorCodec(declared)
        return Reading(port, cast("Vector", values), codec)

    def look(self, observer: str) -> Outputs:
        """Step an observer, such as a camera, at the present state; return the outputs.

        The outputs are neither in the state hash nor in a recording. Raises SessionError if there is no such
        observer.
        """
        planned = self._require_observer(observer)
        participant, h = self._stepped[observer], planned.period * self.plan.step_ns
        if observer not in self._looking:
            directory, connected = self._loaded.source.directory, self.plan.connected_inputs(observer)
            participant.configure(Setup(h, directory, planned.bond_plans, connected))
            self._looking.add(observer)
            if self.step:  # what is sent once is sent at time 0
                participant.step(0, h, self._inputs_of(observer, self._first))
        newest = {name: self._host.newest(name) for name in self.plan.order}
        return participant.step(self.time_ns, h, self._inputs_of(observer, newest))

    def change_observer(self, observer: str, changes: Mapping[str, Any]) -> None:
        """Make an observer, such as a camera, anew with changed parameters, by name as in a scenario.

        Recordings from the next `restart` on state them. Raises SessionError if there is no such observer, or
        for changes that are invalid or change its ports.
        """
        self._require_observer(observer)
        spec, old = self._scenario.participants[observer], self._stepped[observer]
        given: dict[str, Any] = {**spec.params, **changes}
        try:
            files = Files(self._loaded.source.directory)
            params = type(self._params[observer]).model_validate(given, context=files.context)
        except ValidationError as error:
            raise SessionError(f"'{observer}' cannot have {dict(changes)}: {error}") from error
        new = type(old)(observer, params)
        if new.ports != old.ports:
            raise SessionError(f"'{observer}' would have other ports with {dict(changes)}")
        old.close()
        self._looking.discard(observer)
        self._stepped[observer], self._params[observer] = new, params
        others = self._scenario.participants | {observer: spec.model_copy(update=dict(changes))}
        self._scenario = self._scenario.model_copy(update={"participants": others})

    def _require_observer(self, observer: str) -> PlannedParticipant:
        planned = self.plan.participants.get(observer)
        if planned is None or not planned.observer:
            observers = [one.name for one in self.plan.observers()]
            raise SessionError(
                f"'{observer}' is no participant that only looks; there is {', '.join(observers) or 'none'}"
            )
        return planned

    def _inputs_of(self, observer: str, outputs: Mapping[str, Outputs]) -> Inputs:
        feeding = (one for one in self.plan.to_devices if one.target == observer)  # as observers are fed
        return Inputs({one.target_port: outputs[one.source][one.source_port] for one in feeding})

    def _end_recording(self) -> None:
        recorder, self._recorder = self._recorder, None
        if recorder is None or self._monitor is None:
            return
        status = SessionStatus(
            session=self._scenario.name,
            run=_RUN,
            state="done",
            step=self.step,
            sim_time_ns=self.time_ns,
            real_time_factor=0.0,
            late_steps=0,
            dropped_messages=0,
        )
        self._monitor.status(status)
        recorder.close()

    def close(self) -> None:
        """End the recording and close all participants. May be called twice."""
        self._end_recording()
        self._host.close()
        for name in self._looking:
            self._stepped[name].close()
        self._looking.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _copy_outputs(outputs: Outputs) -> dict[str, Value]:
    return {name: v.copy() if isinstance(v, np.ndarray) else v for name, v in outputs.items()}
