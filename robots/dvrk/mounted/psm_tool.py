"""The instrument of a patient-side manipulator in a scenario."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Self

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from robots.dvrk import psm, si
from robots.dvrk.end_effectors.contact_sphere import ContactSphere
from robots.dvrk.end_effectors.end_effector import EndEffector
from robots.dvrk.end_effectors.own_jaw import JawFile, with_own_jaw
from robots.dvrk.instruments import Instrument, instrument
from robots.dvrk.parameters import InstrumentName, MountedPositions, check_start, home, start_positions
from robots.serial_chain import SerialChain
from schemas.errors import MotionError
from schemas.files import find_file
from schemas.quantity import Angle

__all__ = ["DEFAULT_INSTRUMENT", "PsmTool"]

DEFAULT_INSTRUMENT = "palpation-probe"


class PsmTool(BaseModel):
    """Instrument of a patient-side manipulator, and start of both."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    generation: si.Generation = Field(
        default="classic",
        description=(
            "of the da Vinci: si has the Si's ranges, efforts and gains, and instruments of the S and Si"
            " (numbers from 420001), with the Classic's masses and looks"
        ),
    )
    instrument: InstrumentName = Field(
        default=DEFAULT_INSTRUMENT, description="what the arm holds: name or number, such as 400006"
    )
    tip: Path | None = Field(
        default=None,
        description=(
            "file of `trocar instruments import`: fingers of your own in place of the instrument's jaw"
        ),
    )
    start: MountedPositions = Field(
        default_factory=home,
        description=f"joint positions at time 0: {', '.join(psm.JOINT_NAMES)}, or as many as there are",
    )
    jaw: Angle = Field(default=0.0, description="opening of the jaw at time 0")

    @property
    def _stated_positions(self) -> Mapping[str, Sequence[float]]:
        """Stated positions at time 0, by the name of the end effector."""
        return {"jaw": (self.jaw,)}

    @property
    def end_effector(self) -> EndEffector:
        """The instrument's end effector."""
        return self.tool.end_effector

    @property
    def end_effector_start(self) -> tuple[float, ...]:
        """Positions of the end effector's joints at time 0."""
        return start_positions(self.end_effector, self._stated_positions)

    @property
    def spheres(self) -> tuple[ContactSphere, ...]:
        """Contact spheres of the instrument, for tissue."""
        return self.tool.spheres

    @cached_property
    def tool(self) -> Instrument:
        """The instrument's numbers."""
        shaft = instrument(self.instrument)
        if self.generation == "si":
            if not si.fits(shaft):
                raise ValueError(
                    f"generation: {shaft.name} does not fit a PSM of the Si, which takes instruments of the S"
                    " and Si, with numbers from 420001, such as LARGE_NEEDLE_DRIVER_420006"
                )
            shaft = si.fitted(shaft)
        try:
            return shaft if self.tip is None else with_own_jaw(shaft, JawFile.load(self.tip))
        except MotionError as error:
            raise ValueError(f"tip: {error}") from error

    @cached_property
    def chain(self) -> SerialChain:
        """The arm's kinematics, from `<arm>_base` to the tip."""
        return psm.chain(self.tool) if self.generation == "classic" else si.fitted_chain(self.tool)

    @field_validator("tip")
    @classmethod
    def _find_tip(cls, file: Path | None, info: ValidationInfo) -> Path | None:
        return None if file is None else find_file(file, info)

    @model_validator(mode="after")
    def _starts_in_range(self) -> Self:
        check_start(self.chain, self.start, self.end_effector, self._stated_positions)
        return self
