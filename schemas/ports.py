"""Ports and bonds: what a participant declares before it is started."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from schemas.errors import MessageError
from schemas.ros import Float64MultiArray, PoseStamped, TwistStamped, WrenchStamped

__all__ = ["COORDINATE_UNITS", "BondSide", "Port", "bond_ports"]

COORDINATE_UNITS = {"length": ("m", "m/s", "N"), "angle": ("rad", "rad/s", "N*m")}
"""Units of position, velocity and force of generalised coordinates."""


class Port(BaseModel):
    """A named, typed input or output of a participant.

        Port(name="PSM1/tip_wrench", causality="output", type="geometry_msgs/msg/WrenchStamped")
        Port(name="force", causality="input", unit="N", start=(0.0,))     # an array with a single number

    A *signal* has one value at a time, a float64 vector whenever the type has a fixed layout (see
    `schemas.vectors`). An *event* port carries a queue of messages without loss. A signal may feed an event
    port: each new value is a message.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    """Parts separated by `/`, such as `PSM1/measured_js`."""
    causality: Literal["input", "output"]
    type: str = Float64MultiArray.ros_type
    variability: Literal["signal", "event"] = "signal"
    size: int = Field(default=1, ge=1)
    """Number of elements where the type leaves it open (multi-arrays)."""
    shape: tuple[int, ...] = ()
    """Shape of a matrix in a multi-array, row after row: in the message's layout; the product is the size."""
    names: tuple[str, ...] = ()
    """Joint names of a `JointState`."""
    fields: tuple[Literal["position", "velocity", "effort"], ...] = ("position",)
    """The parts of a `JointState` stated, in this order in the vector."""
    unit: str = ""
    """Unit of a bare number or array; empty where the message type implies SI units."""
    frame: str = ""
    """`frame_id` in which the value is expressed, or empty. An input without a frame accepts any."""
    period_ns: int = Field(default=0, ge=0)
    """An output is produced at this period, a multiple of the step; 0: whenever the participant steps."""
    start: tuple[float, ...] | None = None
    """Value of an input while nothing is connected (FMI's word); None: the input must be connected.

    An input of a message without a vector form has no value while nothing is connected: an empty tuple.
    """
    limits: tuple[float, float] | None = None
    """Least and greatest value of a tunable parameter; None: the port is no tunable parameter.

    A tunable parameter is a signal of one number without a connection, for people to change while the session
    runs; `start` is the value at the start.
    """
    max_age_ns: int = Field(default=0, ge=0)
    """A stream inlet is marked stale when its last sample is older, and before the first; 0: never older."""
    clock: Literal["simulated", "wall"] = "simulated"
    """The clock of the stamps."""
    description: str = ""

    @model_validator(mode="after")
    def _starts_within_limits(self) -> Port:
        if self.limits is None:
            return self
        if (self.causality, self.variability, self.size) != ("input", "signal", 1) or self.start is None:
            raise ValueError(f"port '{self.name}': limits are for an input signal of one number with a start")
        least, most = self.limits
        if not least <= self.start[0] <= most:
            raise ValueError(f"port '{self.name}' starts at {self.start[0]:g}, outside {least:g} to {most:g}")
        return self

    def check_limits(self, value: float) -> None:
        """Raise MessageError if `value` is outside the limits of this tunable parameter."""
        if self.limits is not None and not self.limits[0] <= value <= self.limits[1]:
            least, most = self.limits
            raise MessageError(
                f"'{self.name}' = {value:g} is outside its limits: {least:g} to {most:g} {self.unit}".rstrip()
            )

    def filled_from(self, other: Port) -> Port:
        """Return this port with the open frame and joint names filled from `other`."""
        return self.model_copy(
            update={"frame": self.frame or other.frame, "names": self.names or other.names}
        )


class BondSide(BaseModel):
    """An end of a power bond.

        BondSide(name="tip", side="motion", dof=3, effective_mass=0.3)
        BondSide(name="probe", side="force", dof=3, stiffness=500.0, damping=1.0, proxy_mass=0.05)

    The motion side outputs pose and twist and receives a wrench, the force side the reverse.

    `dof` 6 is a rigid frame (pose, twist, wrench); 1 to 3 are generalised coordinates (position, velocity,
    force). With `dof` 3 there may be several `points`, the contact spheres of one instrument: their
    coordinates follow each other. The stable-step rule and the linearised coupling use the numbers;
    stiffness, damping and proxy mass are those at each point.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    side: Literal["motion", "force"]
    dof: Literal[1, 2, 3, 6] = 6
    coordinate: Literal["length", "angle"] = "length"
    """Kind of generalised coordinates: m, m/s and N, or rad, rad/s and N m; then numbers for the rule are in
    N m/rad, N m s/rad and kg m^2.
    """
    points: int = Field(default=1, ge=1)
    """How many points of `dof` 3 are bonded together; else 1."""
    frame: str = ""
    stiffness: float | None = None
    """Force side: stiffness k of the virtual coupling, N/m."""
    damping: float | None = None
    """Force side: damping b of the virtual coupling, N s/m."""
    proxy_mass: float | None = None
    """Force side: mass of the proxy, kg."""
    proxy_step: float = 0.0
    """Force side: sub-step of the proxy's motion, s; 0: continuous motion."""
    contact_stiffness: float | None = None
    """Force side: estimated stiffness in contact with the proxy, N/m."""
    effective_mass: float | None = None
    """Motion side: smallest effective mass at the bond, kg; known once the participant is configured.

    1 / max eig(J M^-1 J^T) with J, shape (size, nv), of all points together: with n springs on one body each
    must see a mass of m / n.
    """

    @model_validator(mode="after")
    def _points_are_points(self) -> BondSide:
        if self.points > 1 and self.dof != 3:
            raise ValueError(f"bond '{self.name}': several points are for dof 3, not for dof {self.dof}")
        return self

    @property
    def size(self) -> int:
        """Number of elements of velocity and force."""
        return self.dof * self.points

    @property
    def linear(self) -> int:
        """Number of elements of a position, or of a pose that are lengths: all but a quaternion."""
        return 3 if self.dof == 6 else self.size


def bond_ports(bond: BondSide) -> tuple[Port, Port, Port]:
    """Return the three ports of a bond side: position or pose, velocity or twist, force or wrench.

    The names are `<bond>/pose`, `<bond>/twist`, `<bond>/wrench` for a frame and `<bond>/position`,
    `<bond>/velocity`, `<bond>/force` for generalised coordinates, point after point.
    """
    moves, takes = ("output", "input") if bond.side == "motion" else ("input", "output")
    if bond.dof == 6:
        rows = (
            ("pose", PoseStamped.ros_type, ""),
            ("twist", TwistStamped.ros_type, ""),
            ("wrench", WrenchStamped.ros_type, ""),
        )
        size = 1
    else:
        rows = tuple(
            (name, Float64MultiArray.ros_type, unit)
            for name, unit in zip(
                ("position", "velocity", "force"), COORDINATE_UNITS[bond.coordinate], strict=True
            )
        )
        size = bond.size
    position, velocity, force = (
        Port(
            name=f"{bond.name}/{name}",
            causality=causality,
            type=type_,
            size=size,
            unit=unit,
            frame=bond.frame,
        )
        for (name, type_, unit), causality in zip(rows, (moves, moves, takes), strict=True)
    )
    return position, velocity, force
