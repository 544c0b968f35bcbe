"""The hub's knowledge of the run: reported as a status, a progress line, and a summary at the end."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic_ns

from hub.devices.session_devices import SessionDevices
from hub.observation.latency import Histogram, by_way
from hub.observation.monitor import Monitor
from hub.observation.outcome import verdict
from hub.observation.summary import Progress, Summary
from hub.planning.plan import PlannedParticipant
from hub.recording.profiles import profile_numbers
from hub.recording.recorder import RecorderSummary
from hub.recording.scores import score_numbers
from hub.session.clock import Clock
from hub.session.observer_reports import ObserverReports
from hub.session.state_digests import StateDigests
from hub.transport.run_connection import RunConnection
from schemas.lockstep import Ack
from schemas.scenario import Scenario
from schemas.trocar_msgs import Latency, ParticipantStatus, Profile, SessionStatus

__all__ = ["Bookkeeping"]


class Bookkeeping:
    """Keeps the phase, the times, and the state hashes of a run."""

    def __init__(
        self,
        scenario: Scenario,
        run: RunConnection,
        clock: Clock,
        monitor: Monitor,
        devices: SessionDevices,
        observer_reports: ObserverReports,
    ) -> None:
        self.phase = "starting"
        """`starting`, `running`, `paused`, `done` or `failed`."""
        self.detail = ""
        """Cause of a failure, or the participant ending the run early."""
        self._scenario = scenario
        self._plan = run.plan
        self._run = run
        self._clock = clock
        self._monitor = monitor
        self._devices = devices
        self._observer_reports = observer_reports
        self._answers = Histogram()
        self._digests = StateDigests(run.plan.order)
        self._last_steps = dict.fromkeys(run.plan.order, -1)
        self._started_ns: int | None = None
        self._wall_ns: int | None = None

    def start(self) -> None:
        """Start to count wall time: the first step begins."""
        self.phase = "running"
        self._started_ns = monotonic_ns()

    def stop(self) -> None:
        """Stop to count wall time: the last step is done."""
        self._wall_ns = self._wall_so_far_ns

    def count_answer_time(self, granted_ns: int) -> None:
        """Count the time since a grant was given at `granted_ns` (monotonic): all its steps are done."""
        self._answers.add(monotonic_ns() - granted_ns)

    def book(self, planned: PlannedParticipant, ack: Ack) -> int:
        """Book the hashes and the last step of an ack; return the simulated time (ns) at its end."""
        self._digests.add(planned.name, ack.state_hash)
        first = ack.step + -ack.step % planned.period
        last = self._last_steps[planned.name] = first + (len(ack.state_hash) - 1) * planned.period
        return (last + planned.period) * self._plan.step_ns

    def progress(self) -> Progress:
        """Return where the run is now."""
        sim_s, wall_ns = self._clock.time_ns / 1e9, self._wall_so_far_ns
        factor = sim_s / (wall_ns / 1e9) if wall_ns else 0.0
        return Progress(
            self._clock.step,
            self._clock.steps,
            sim_s,
            factor,
            self._clock.late_steps,
            self._monitor.measures.live(),
        )

    def status(self, pid: Callable[[str], int]) -> SessionStatus:
        """Return the present status of the session; `pid` returns the process id of a host."""
        participants = [
            ParticipantStatus(
                name=planned.name,
                role=planned.role,
                host=planned.host,
                pid=pid(planned.host),
                step=self._last_step(planned),
            )
            for planned in self._plan.participants.values()
        ]
        progress = self.progress()
        return SessionStatus(
            session=self._scenario.name,
            run=self._run.number,
            state=self.phase,
            step=progress.step,
            sim_time_ns=self._clock.time_ns,
            real_time_factor=progress.real_time_factor,
            late_steps=progress.late_steps,
            dropped_messages=self._dropped,
            detail=self.detail or self._observer_reports.lost,
            participants=participants,
            devices=self._devices.statuses,
            latencies=self._latencies,
        )

    def _last_step(self, planned: PlannedParticipant) -> int:
        """Return the last known step of a participant; for a device, the last step of the session."""
        if planned.observer:
            return self._observer_reports.step(planned.name)
        return self._last_steps.get(planned.name, self._clock.step)

    def summary(self, recorded: RecorderSummary | None, profile: Profile | None) -> Summary:
        """Return the summary of the run."""
        progress, measures = self.progress(), self._monitor.measures.results()
        cards = sorted(self._monitor.measures.score_cards.items())
        scores = {name: score_numbers(card) for name, card in cards}
        result = verdict(self._scenario, measures, scores)
        return Summary(
            session=self._scenario.name,
            state=self.phase,
            steps=progress.step,
            sim_time_s=progress.sim_time_s,
            wall_time_s=(self._wall_ns or 0) / 1e9,
            real_time_factor=progress.real_time_factor,
            late_steps=progress.late_steps,
            dropped_messages=self._dropped,
            state_hash=self._digests.whole,
            recording=None if recorded is None else str(recorded.path),
            recording_complete=None if recorded is None else recorded.complete,
            energy_residual_j=self._monitor.energy.residual_j,
            latency=by_way(self._latencies),
            observers=self._observer_reports.observed_states(),
            outcome=result.text,
            succeeded=result.succeeded,
            measures=measures,
            missing=self._monitor.measures.missing(),
            units={name: one.si_unit for name, one in self._scenario.measure.items() if one.si_unit},
            scores=scores,
            warnings=self._monitor.measures.warnings,
            ending=self.detail or None,
            profile=None if profile is None else profile_numbers(profile),
        )

    @property
    def _wall_so_far_ns(self) -> int:
        if self._started_ns is None:
            return 0
        return monotonic_ns() - self._started_ns if self._wall_ns is None else self._wall_ns

    @property
    def _latencies(self) -> list[Latency]:
        answers = [self._answers.message("grant to state", "all participants")] if self._answers.count else []
        return [*answers, *self._devices.latencies, *self._observer_reports.latencies]

    @property
    def _dropped(self) -> int:
        return self._run.refusals.total + self._monitor.refusals.total
