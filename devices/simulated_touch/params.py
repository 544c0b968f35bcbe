"""Parameters of simulated styluses and of the hands at the styluses."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated, ClassVar

from pydantic import Discriminator, Field, StringConstraints, Tag, ValidationInfo, field_validator

from devices.haptics.limits import TOUCH
from devices.haptics.params import SafetyParams
from hub.participant import Params
from hub.recording.bag_files import bag_file
from robots.dvrk.parameters import UnitQuaternion
from schemas.errors import RecordingError, ScenarioError
from schemas.files import find_file
from schemas.quantity import Damping, Duration, Length, Mass, Stiffness

__all__ = ["LEVEL", "HandParams", "SimulatedStylusParams", "SimulatedTouchParams", "Waypoint"]

LEVEL = (-0.5, 0.5, -0.5, 0.5)
"""Orientation (x, y, z, w) of a stylus pointing level away from the user: z along x of the base frame,
x along -y, y along -z.
"""


class Waypoint(Params):
    """Target of the hand at a time, at rest. Omitted fields are as in the waypoint before."""

    at: Duration = Field(ge=0, description="time since the start")
    position: tuple[Length, Length, Length] | None = Field(
        default=None, description="of the tip in the stylus' base frame: x ahead, y left, z up"
    )
    orientation: UnitQuaternion | None = Field(
        default=None, description="of the stylus in its base frame: quaternion x, y, z, w"
    )
    buttons: Annotated[tuple[int, ...], Field(max_length=2)] | None = Field(
        default=None, description="the buttons that are held from this time on: 0, 1"
    )

    @field_validator("buttons")
    @classmethod
    def _check_buttons(cls, buttons: tuple[int, ...] | None) -> tuple[int, ...] | None:
        if buttons is not None and not set(buttons) <= {0, 1}:
            raise ValueError(f"a stylus has the buttons 0 and 1, not {buttons}")
        return buttons


class HandParams(Params):
    """A hand with the stylus: a mass pulled to the target by spring and damper.

    The defaults are from the study of the limits of the force (docs/decisions/0022).
    """

    mass: Mass = Field(default=0.15, gt=0.0, description="of the stylus and what moves with it")
    stiffness: Stiffness = Field(default=200.0, gt=0.0, description="of the grip")
    damping: Damping = Field(default=4.0, ge=0.0, description="of the grip")


class SimulatedStylusParams(Params):
    """A stylus, the hand at the stylus, and the limits of the force on the hand."""

    path: Annotated[
        Annotated[tuple[Waypoint, ...], Tag("waypoints")] | Annotated[Path, Tag("recording")],
        Discriminator(lambda path: "recording" if isinstance(path, str | Path) else "waypoints"),
    ] = Field(
        description=(
            "targets of the hand: waypoints, with least jerk from one to the next; or a recording of"
            " poses and buttons, an .mcap file or a rosbag2 directory relative to the scenario, in which a"
            " hand without buttons holds the dead-man"
        )
    )
    dead_man: Annotated[int, Field(ge=0, le=1, description="the button that must be held for force")] = 0
    hand: HandParams = HandParams()
    safety: SafetyParams = SafetyParams()

    @field_validator("path")
    @classmethod
    def _check_recording(
        cls, path: tuple[Waypoint, ...] | Path, info: ValidationInfo
    ) -> tuple[Waypoint, ...] | Path:
        """Check the order of the times, and find the recording."""
        if isinstance(path, Path):
            file = find_file(path, info)
            try:
                bag_file(file)
            except RecordingError as error:
                raise ValueError(str(error)) from error
            return file
        if not path:
            raise ValueError("a path has at least one waypoint")
        for before, after in pairwise(path):
            if after.at <= before.at:
                raise ValueError(
                    f"the path's times go forward, but {after.at / 1e9:g} s comes after {before.at / 1e9:g} s"
                )
        return path

    @field_validator("safety")
    @classmethod
    def _check_bearable_force(cls, safety: SafetyParams) -> SafetyParams:
        try:
            safety.within(TOUCH)
        except ScenarioError as error:
            raise ValueError(str(error)) from error
        return safety


class SimulatedTouchParams(Params):
    """The styluses of a simulated device."""

    open_to_pages: ClassVar[bool] = True

    styluses: Annotated[
        dict[Annotated[str, StringConstraints(pattern=r"^[A-Za-z]\w*$")], SimulatedStylusParams],
        Field(min_length=1, description="by name: right, left"),
    ]
    max_age: Annotated[Duration, Field(gt=0, description="a pose or twist that is older is marked stale")] = (
        100_000_000
    )
