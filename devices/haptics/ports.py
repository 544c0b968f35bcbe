"""The ports of a stylus, the same for every haptic device: a scenario can exchange devices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from devices.samples import clock_of
from devices.vendor_axes import Quaternion, Vector3
from hub.participant import Sample, VectorSample, event_out, signal_in, signal_out
from schemas.ports import Port
from schemas.ros import Joy, PoseStamped, TwistStamped, WrenchStamped
from schemas.trocar_msgs import ContactModel
from schemas.vectors import VectorCodec

__all__ = ["StylusPorts", "StylusSamples", "stylus_ports"]


class StylusPorts(NamedTuple):
    """Ports of a stylus, besides `<stylus>/diagnostics`, declared by `devices.diagnosis`."""

    pose: Port
    twist: Port
    buttons: Port
    force: Port
    contact: Port


def stylus_ports(participant: str, stylus: str, *, simulated_time: bool, max_age_ns: int) -> StylusPorts:
    """Return the ports of a stylus.

    All vectors are along the axes of `<participant>_<stylus>_base` (x ahead, y left, z up).
    """
    frame, clock = f"{participant}_{stylus}_base", clock_of(simulated_time=simulated_time)

    tip = "of the tip; z out of the point, x to the right when it points away from the user"
    pose, twist, force = f"{stylus}/pose", f"{stylus}/twist", f"{stylus}/force"
    contact = "contact that is rendered to the hand"
    return StylusPorts(
        signal_out(pose, PoseStamped, tip, frame=frame, max_age_ns=max_age_ns, clock=clock),
        signal_out(twist, TwistStamped, "of the tip", frame=frame, max_age_ns=max_age_ns, clock=clock),
        event_out(f"{stylus}/buttons", Joy, "each press and release", frame=frame, clock=clock),
        signal_out(force, WrenchStamped, "on the hand", frame=frame, clock=clock),
        signal_in(f"{stylus}/contact", ContactModel, contact, frame=frame),
    )


class StylusSamples:
    """Samples of a stylus at every reading, in the frame of the ports, at a time (ns) of the ports' clock."""

    def __init__(self, ports: StylusPorts) -> None:
        self._pose, self._twist, self._force = map(VectorCodec, (ports.pose, ports.twist, ports.force))

    def pose(self, time_ns: int, position: Vector3, orientation: Quaternion) -> Sample:
        """Return the pose of the tip, m and quaternion (x, y, z, w)."""
        return VectorSample(self._pose, np.array((*position, *orientation)), time_ns)

    def twist(self, time_ns: int, linear: Vector3, angular: Vector3) -> Sample:
        """Return the velocity (m/s) of the tip and the angular velocity (rad/s)."""
        return VectorSample(self._twist, np.array((*linear, *angular)), time_ns)

    def force(self, time_ns: int, force: Vector3) -> Sample:
        """Return the force (N) on the hand."""
        return VectorSample(self._force, np.array((*force, 0.0, 0.0, 0.0)), time_ns)
