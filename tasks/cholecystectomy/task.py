"""The cholecystectomy task: what was done to which organ, and how well."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from hub.participant import Inputs, Outputs, Params, Setup
from robots import rotation
from schemas.ports import Port
from schemas.vectors import Vector
from tasks.cholecystectomy.bleeding import Losses
from tasks.cholecystectomy.critical_view import CriticalView
from tasks.cholecystectomy.energy import Energy
from tasks.cholecystectomy.grasping import Grasping
from tasks.cholecystectomy.harm import Harm
from tasks.cholecystectomy.organs import ORGANS, TARGETS
from tasks.cholecystectomy.outcome import Outcome
from tasks.cholecystectomy.params import CholecystectomyParams
from tasks.cholecystectomy.phases import PHASES, Phases
from tasks.cholecystectomy.ports import operation_outputs, tissue_inputs
from tasks.cholecystectomy.tissue_seen import TissueSeen
from tasks.cholecystectomy.tube_metrics import TubeMetrics
from tasks.cholecystectomy.tubes import TubeWatch
from tasks.events import Event
from tasks.goals import Goals
from tasks.instant import Instant, base_pose
from tasks.metrics.camera import BothHands, CameraMoves
from tasks.metrics.metric import AnyMetric
from tasks.task import Task

__all__ = ["CholecystectomyTask"]


class CholecystectomyTask(Task):
    """Phases, clips, cuts, critical view, losses, harm and errors of the operation or a part of it."""

    params_model: ClassVar[type[Params]] = CholecystectomyParams
    name_of_kind: ClassVar[str] = "cholecystectomy-task"
    default_rules: ClassVar[tuple[str, ...]] = ("cvs-doublet", "goals", "gears", "osats", "ochra", "mscore")

    def __init__(self, name: str, params: CholecystectomyParams) -> None:
        self._seen = seen = TissueSeen(params.probes)
        self._bases = [base_pose(params, arm)[:3, :3] for arm in params.psms]
        self._turns: Vector = np.zeros((len(params.psms), 4))
        self._tubes = tuple(TubeWatch(tube, params, self._axis) for tube in TARGETS)
        self._harm, self._losses, self._grasping = Harm(seen), Losses(seen), Grasping(seen)
        self._energy = Energy(seen, 1e-9 * params.idle_power)
        self._view = CriticalView(seen, self._tubes)
        self._phases = Phases(seen, self._tubes, len(ORGANS))
        self._outcome = Outcome(params, self._tubes, self._losses.state)
        self._hands = BothHands(len(params.psms), params.idle_speed)
        self._ecm = params.ecm
        self._camera = CameraMoves(params.idle_speed)
        self._numbers = {name: np.zeros(1) for name in ("blood", "bile", "errors", "success", "failure")}
        super().__init__(name, params)

    @property
    def goals(self) -> Goals:
        """Organs and phases, as the places of events."""
        return Goals(places=(*ORGANS, *PHASES))

    @property
    def goal_count(self) -> int:
        """Number of events that finish this part of the operation."""
        return len(self._outcome.goals)

    @property
    def more_metrics(self) -> tuple[AnyMetric, ...]:
        """Everything about tissue, camera and both hands."""
        tubes = (TubeMetrics(tube, self._seen.organs[tube.name]) for tube in self._tubes)
        return (
            self._outcome,
            self._phases,
            self._view,
            *tubes,
            self._losses,
            self._harm,
            self._energy,
            self._grasping,
            self._camera,
            self._hands,
        )

    @property
    def ports(self) -> tuple[Port, ...]:
        """Inputs of every task, tissue and energy; outputs for the summary."""
        return (*super().ports, *tissue_inputs(self.params.probes), *operation_outputs())

    def configure(self, setup: Setup) -> Outputs:
        """Prepare metrics and rules for the connected inputs."""
        self._seen.connect(setup.connected)
        self._camera.is_known = f"{self._ecm}/measured_cp" in setup.connected
        super().configure(setup)
        self._outputs |= self._numbers
        return self._outputs

    def observe(self, inputs: Inputs, now: Instant) -> None:
        """Read tissue, instruments and endoscope."""
        self._seen.read(inputs)
        self._turns = now.turns
        if self._camera.is_known:
            self._camera.position[:] = inputs[f"{self._ecm}/measured_cp"][:3]

    def more_events(self, now: Instant) -> Iterable[Event]:
        """Return the events of the operation."""
        seen = self._seen
        self._losses.observe(now)
        found: list[Event] = [*self._grasping.observe(now), *self._energy.observe(now)]
        for tube in self._tubes:
            found += tube.observe(seen.organs[tube.name], seen.arm_index)
        found += self._harm.observe(seen.arm_index)
        is_clipped = any(event.kind == "clip closed" for event in found)
        found += self._view.observe(is_clipped=is_clipped)
        found += self._phases.observe(now, freed=self._view.is_freed)
        found = [event for event in found if not self._outcome.is_repeated(event, now)]
        self._outcome.count(found)
        self._report()
        return found

    def reaches(self, event: Event) -> bool:
        """Say whether an event reaches a goal of this part of the operation."""
        return self._outcome.reach(event, self._now)

    def _report(self) -> None:
        numbers, losses = self._numbers, self._losses.state
        numbers["blood"][0], numbers["bile"][0] = losses.blood, losses.bile
        numbers["errors"][0] = self._outcome.state.errors.sum()
        numbers["success"][0], numbers["failure"][0] = self._outcome.success, self._outcome.failure

    def _axis(self, arm: int) -> Vector:
        """Return the direction in which an arm's tip points, in `world`, shape (3,)."""
        axis: Vector = self._bases[arm] @ rotation.matrix(self._turns[arm])[:, 2]
        return axis
