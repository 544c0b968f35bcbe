"""A session: the hub's side of a run, from joining to summary."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from hub.hosting.interrupt import Interrupt
from hub.observation.summary import Progress, Summary
from hub.participant import Device, Stepped
from hub.planning.contacts import MissingContact
from hub.planning.plan import Plan
from hub.planning.session_parameters import Successors
from hub.recording.recorder import Recorder
from hub.security.gate import Gate
from hub.security.outer_router import OuterRouter
from hub.session.past import Past
from hub.session.run import Run, SessionSpec
from hub.session.run_state import RunState
from hub.session.startup import start
from hub.session.step_loop import OnAck, StepLoop
from hub.transport.hub_files import hub_file
from hub.transport.loopback_port import LoopbackPort
from hub.transport.session_secret import listen_with_secret
from schemas.errors import ParticipantError, ScenarioError, SessionError
from schemas.scenario import Scenario
from schemas.trocar_msgs import Profile

__all__ = ["Session"]

log = logging.getLogger(__name__)


class Session:
    """A run of a scenario, with this process as hub and router.

    Args:
        scenario: The scenario.
        plan: The wiring of the scenario.
        participants: Participants in this process, by name.
        directory: Base of relative paths of the scenario.
        endpoint: The hub's endpoint on loopback; by default at a free port.
        gate: The gate for remote machines.
        foreign_keys: Keys shared by devices and programs.
        open_to_programs: Programs without the secret of the session connect to a separate router.
        record: The directory of the recording.
        attachments: Contents of the recording beside the messages, by name.
        past: The recorded part of this run, to be simulated again before the run goes on, or instead.
        successors: Successors in this process of `participants`, each with the first step.
        on_ack: Is called with every participant's ack of every grant.
        profile: Measure the use of time, for summary, recording and `trocar ls`.
        missing_contacts: Tools that pass through tissue: a warning says so when one enters it.
    """

    def __init__(
        self,
        scenario: Scenario,
        plan: Plan,
        participants: Mapping[str, Stepped | Device],
        directory: Path,
        *,
        endpoint: str | LoopbackPort | None = None,
        gate: Gate | None = None,
        foreign_keys: Sequence[str] = (),
        open_to_programs: bool = False,
        record: Path | None = None,
        attachments: Mapping[str, bytes] | None = None,
        past: Past | None = None,
        successors: Successors | None = None,
        on_ack: OnAck | None = None,
        profile: bool = False,
        missing_contacts: Sequence[MissingContact] = (),
    ) -> None:
        self.scenario = scenario
        self.plan = plan
        self._port = endpoint if isinstance(endpoint, LoopbackPort) else LoopbackPort(endpoint)
        programs = None
        if open_to_programs:
            # programs look for the first port; one that was given is the hub's
            programs, given = self._port.another(), self._port
            if not given.given:
                programs, self._port = given, programs
        self._shares_keys = bool(foreign_keys)
        self._outer = OuterRouter(programs, foreign_keys, gated=gate is not None)
        self.gate = gate
        self.state = RunState()
        self._participants = participants
        self._directory = directory
        self._record = record
        self._attachments = dict(attachments or {})
        self._past = past
        self._successors = successors or {}
        self._on_ack = on_ack
        self._profiled = profile
        self._missing_contacts = missing_contacts
        self._profile: Profile | None = None

    @property
    def endpoint(self) -> str:
        """The hub's endpoint on loopback; unless given, the port may change in `run`."""
        return self._port.endpoint

    @property
    def programs_endpoint(self) -> str:
        """Endpoint for ROS programs and the like; empty if no device is open to programs without a secret."""
        return self._outer.programs

    def run(self, progress: Callable[[Progress], None] | None = None) -> Summary:
        """Run to the end and return the summary. SIGTERM ends the run in the same way as Ctrl-C.

        Call this in the main thread: only there can a participant of this process be interrupted while
        hanging or waiting for a dead participant.

        Raises ParticipantError or SessionError when the session fails (the recording is then closed and
        readable), ScenarioError if a bond's step is unstable, ConnectError if the endpoint is taken.
        """
        recorder = Recorder(self._record, attachments=self._attachments) if self._record is not None else None
        with Interrupt() as interrupt:
            try:
                with (
                    self._outer.opened(),
                    listen_with_secret(self._port, connect=self._outer.inside) as session,
                    hub_file(
                        self.endpoint,
                        self.gate.endpoints if self.gate is not None else (),
                        session=self.scenario.name,
                        programs=self.programs_endpoint or (self.endpoint if self._shares_keys else ""),
                    ),
                    ExitStack() as stack,
                ):
                    spec = SessionSpec(
                        self.scenario,
                        self.plan,
                        self._participants,
                        self._directory,
                        self.endpoint,
                        self.programs_endpoint,
                        self.gate,
                        past=self._past,
                        successors=self._successors,
                        profiled=self._profiled,
                        recording="" if self._record is None else str(self._record.resolve()),
                        missing_contacts=self._missing_contacts,
                    )
                    run = Run(stack, spec, session, self.state, interrupt, recorder)
                    self._step(run, interrupt, progress)
            finally:
                interrupt.disarm()  # a second SIGTERM does not cut the recording short
                recorded = recorder.close() if recorder is not None else None
        return run.bookkeeping.summary(recorded, self._profile)

    def _step(self, run: Run, interrupt: Interrupt, progress: Callable[[Progress], None] | None) -> None:
        """Start a run and step to the end; the last status reports the end."""
        steps = StepLoop(run, self._on_ack)
        if run.profile is not None:
            steps.show_to(run.profile)
        try:
            if self.gate is not None:
                self.gate.open(*self._outer.inside)
            _start_and_step(run, steps, interrupt, progress)
            run.bookkeeping.phase = "done"
        except SessionError as error:
            run.bookkeeping.detail = str(error)
            log.error("ending the session: %s", error)  # at once: closing everything may take a while
            raise
        finally:
            steps.book_acks()
            if run.bookkeeping.phase != "done":
                run.bookkeeping.phase = "failed"
            if run.profile is not None:
                self._profile = run.profile.finish()
            run.status.publish()


def _start_and_step(
    run: Run, steps: StepLoop, interrupt: Interrupt, progress: Callable[[Progress], None] | None
) -> None:
    """Start and step; nothing interrupts the code after this call.

    A failure brings others, reported at any moment: only the first one is raised. ctypes turns an interrupt
    in the conversion of an argument into an error of the participant.
    """
    interrupted = False
    try:
        try:
            start(run)
            if run.profile is not None:
                run.profile.start()
            steps.step_to_end(progress)
        finally:
            interrupted = interrupt.raised
            interrupt.disarm()
    except (KeyboardInterrupt, ParticipantError) as ending:
        if isinstance(ending, ParticipantError) and not interrupted:
            raise
        if isinstance(ending.__context__, SessionError | ScenarioError):  # it was raised just before
            raise ending.__context__ from None
        run.failure.check()
        raise SessionError(f"interrupted at step {run.clock.step}") from None
