"""Stitches in a phantom: events of needle and tissue, accuracy, trauma, and the rules of the challenge."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Self, cast

from pydantic import Field, model_validator

from hub.participant import Inputs, Outputs, Params, Setup, event_in, signal_in
from robots.training.fixtures import FixtureParams, PhantomParams
from robots.training.needle_object import NeedleObject, needles_of
from schemas.ports import Port
from schemas.ros import BoolMessage, Float64Message, PoseStamped
from schemas.trocar_msgs import TaskEvent
from tasks.events import Event, EventKind
from tasks.goals import Goals
from tasks.instant import Instant
from tasks.metrics.metric import AnyMetric
from tasks.metrics.stitches import Stitches, TissueSeen
from tasks.params import TaskParams
from tasks.rules import Suture
from tasks.task import Task

__all__ = ["SuturingParams", "SuturingTask"]

_KINDS: dict[str, EventKind] = {
    "entered": "entered",
    "exited": "exited",
    "withdrawn": "withdrawn",
    "pulled out": "stitched",
}
_SIGNALS = (("depth", "m"), ("resistance", "N"), ("trauma", "m^2"))


class SuturingParams(TaskParams):
    """Phantom, needle, and number of stitches."""

    open_to_pages: ClassVar[bool] = True

    fixtures: dict[str, FixtureParams] = Field(description="as in the scene: one of them is the phantom")
    objects: dict[str, Any] = Field(description="as in the scene: one of them is the needle")
    stitches: int = Field(default=4, ge=1, description="after which the task is done")

    @model_validator(mode="after")
    def _one_of_each(self) -> Self:
        phantoms = [name for name, one in self.fixtures.items() if isinstance(one, PhantomParams)]
        needles = list(needles_of(self.objects))
        if len(phantoms) != 1 or len(needles) != 1:
            raise ValueError(
                f"the scene has {len(phantoms)} phantoms and {len(needles)} needles; one of each is needed"
            )
        return self

    @property
    def phantom(self) -> PhantomParams:
        """The phantom with its pose."""
        return next(one for one in self.fixtures.values() if isinstance(one, PhantomParams))

    @property
    def needle(self) -> tuple[str, NeedleObject]:
        """Name and wire of the needle."""
        return next(iter(needles_of(self.objects).items()))


class SuturingTask(Task):
    """A needle through all pairs of holes; a goal is a needle pulled all through."""

    params_model: ClassVar[type[Params]] = SuturingParams
    name_of_kind: ClassVar[str] = "suturing-task"
    default_rules: ClassVar[tuple[str, ...]] = (
        "src1",
        "src2-script",
        "src2-rules",
        "src3-script",
        "src3-rules",
        "mscore",
    )

    def __init__(self, name: str, params: SuturingParams) -> None:
        self._phantom, self._thing = params.phantom, params.needle[0]
        self._shape, self._wanted = params.needle[1].shape, params.stitches
        self._holes = self._phantom.pose @ self._phantom.measures.holes
        self._tissue = TissueSeen()
        self._entered: tuple[TaskEvent, ...] = ()
        self._connected = frozenset[str]()
        super().__init__(name, params)

    @property
    def goals(self) -> Goals:
        """The holes."""
        return Goals(places=self._phantom.measures.names, positions=self._holes[:, :3, 3])

    @property
    def goal_count(self) -> int:
        """How many stitches are to be made."""
        return self._wanted

    @property
    def suture(self) -> Suture:
        """Setting for the rules of the challenge."""
        return Suture(
            holes=self._holes,
            needle=self._shape,
            thing=self.things.index(self._thing),
            estimated="estimate/pose" in self._connected,
            asked="report" in self._connected,
        )

    @property
    def more_metrics(self) -> tuple[AnyMetric, ...]:
        """How well the stitches are made."""
        return (Stitches(self._tissue, self._holes[:, :3, 3]),)

    def reaches(self, event: Event) -> bool:
        """Say whether a needle has been pulled all through."""
        return event.kind == "stitched"

    @property
    def ports(self) -> tuple[Port, ...]:
        """Inputs of every task, the tissue, an estimate of the needle's pose, and a report."""
        return (*super().ports, *_tissue_ports())

    def configure(self, setup: Setup) -> Outputs:
        """Prepare metrics and rules for the connected inputs."""
        self._connected = setup.connected
        self._tissue.is_known = "tissue/trauma" in setup.connected
        return super().configure(setup)

    def observe(self, inputs: Inputs, now: Instant) -> None:
        """Read the tissue, the estimate and the report."""
        tissue = self._tissue
        tissue.depth, tissue.force, tissue.trauma = (
            float(inputs[f"tissue/{name}"][0]) for name, _ in _SIGNALS
        )
        tissue.entry[:], tissue.exit[:] = inputs["tissue/entry"], inputs["tissue/exit"]
        self._entered = cast("tuple[TaskEvent, ...]", inputs.events("tissue/events"))
        now.estimate[:] = inputs["estimate/pose"]
        said = cast("tuple[BoolMessage, ...]", inputs.events("report"))
        now.reported = any(message.data for message in said)

    def more_events(self, now: Instant) -> Iterator[Event]:
        """Yield the events of the tissue."""
        places = {name: i for i, name in enumerate(self._phantom.measures.names)}
        thing = self.things.index(self._thing)
        for event in self._entered:
            if kind := _KINDS.get(event.event):
                place = places.get(event.place, -1)
                yield Event(kind, thing, now.holders[thing], place, event.value, event.unit)


def _tissue_ports() -> Iterator[Port]:
    estimate = "of the needle, as a tracker has it: challenge 1 compares it with where the needle is"
    for name, unit in _SIGNALS:
        yield signal_in(f"tissue/{name}", Float64Message, unit=unit, start=(0.0,))
    for name in ("entry", "exit"):
        yield signal_in(f"tissue/{name}", size=3, unit="m", start=(0.0, 0.0, 0.0))
    yield event_in("tissue/events", TaskEvent, "of a suturing pad")
    yield signal_in("estimate/pose", PoseStamped, estimate, frame="world", start=(*(0.0,) * 6, 1.0))
    yield event_in("report", BoolMessage, "true: the stitch is made; without a source, as soon as it counts")
