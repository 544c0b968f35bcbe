"""The mechanics of a needle in tissue: skin, channel, tip. No ports, no bonds. SI units.

Frame `pad`: z = 0 is the skin at rest, tissue is at z < 0. The frame of a needle is defined in
`robots.training.needles`: origin in the arc's centre, z normal to the arc's plane; the angle of the tip is
arc/2.

A needle through the skin leaves a channel, a row of points fixed in the tissue at rest. In the needle's frame
a channel point has the angle a, the distance p from the axis and the height z. On the wire p = r and z = 0;
the difference is the displacement of the tissue, and

    compression: K ds [(p - r) e_p + z e_z]  on the needle at each covered point: K times the swept area
    friction:    c ds                        against the motion along the arc, after slipping
    cutting:     up to F_cut at the tip      against the advance, at the end of the channel

Compression is the gradient of K/2 times the sum of squares: conservative. Friction and cutting are springs
slipping at their largest force (Prandtl): the energy returned is never more than the energy stored. A needle
can leave its channel only along the arc: no other motion makes the displacement vanish.
"""

from __future__ import annotations

from enum import IntEnum
from math import acos, atan2, ceil, hypot, pi

import numpy as np

from engines.suture_pad.tissue import TissueParams
from hub.participant import Record, array, choice, flag, integer, number
from robots.training.needles import NeedleShape
from robots.vector3 import cross
from schemas.vectors import Vector

__all__ = ["SPACING", "Channel", "ChannelState", "Phase"]

SPACING = 0.5e-3
"""Distance of neighbouring points of a channel, m."""


class Phase(IntEnum):
    """Where the tip is."""

    OUT = 0
    PRESSING = 1
    """On the unbroken skin."""
    IN = 2
    THROUGH = 3
    """Out again, at the far end of the channel."""


class ChannelState(Record):
    """State of the tissue around a needle."""

    phase = choice(Phase.OUT)
    count = integer()
    """Number of points of the channel."""
    points = array("most", 3)
    """m, frame `pad`."""
    cut = number()
    """Length of the channel, m."""
    slid = number()
    """Where along the arc the wire would have to be for no friction, m."""
    length = number()
    """Way of the tip along the arc since the skin, m."""
    came_out = array(3)
    """Where the wire passed the skin when the tip broke out, m, frame `pad`."""
    touched = array(3)
    """Where the tip meets the skin, m, frame `pad`."""
    swept = number()
    """Area between needle and channel now, m^2."""
    tip = number()
    """Force against the tip's way, N."""
    pulled_out = flag()
    """Whether the last needle has left by the far end of the channel."""
    covered = number()
    """Length of the channel filled by the needle, m."""


class Channel:
    """A needle and the tissue under a skin."""

    def __init__(self, needle: NeedleShape, tissue: TissueParams) -> None:
        self._needle, self._tissue = needle, tissue
        self._most = ceil(2.0 * needle.length / SPACING)
        self.state = ChannelState(most=self._most)
        self._arclengths = SPACING * np.arange(self._most, dtype=np.float64)
        stations = np.linspace(-needle.arc / 2.0, needle.arc / 2.0, ceil(needle.length / 1e-3) + 1)
        self._stations = needle.points(stations)
        self._share = needle.length / len(stations)
        self._tip = self._stations[-1]
        self._forward = np.array([-np.sin(needle.arc / 2.0), np.cos(needle.arc / 2.0), 0.0])
        self._followed: tuple[Vector, Vector, Vector, Vector] | None = None
        """Last pose in a channel: rotation, points in the needle's frame (m), distances of the points from
        the axis (m), and shares of the points covered by the wire.
        """
        self._stretch = np.zeros(3)

    def advance(self, rotation: Vector, origin: Vector, *, over_pad: bool) -> tuple[Vector, Vector]:
        """Follow the needle to a pose; return force (N) and moment (N m, about 0) on the needle, in `pad`.

        Args:
            rotation: rotation of the needle in `pad`, shape (3, 3).
            origin: origin of the needle's frame in `pad`, m, shape (3,).
            over_pad: whether there is tissue under the tip.
        """
        state = self.state
        lowest = float(origin[2]) - self._needle.radius * hypot(rotation[2, 0], rotation[2, 1])
        if lowest > self._needle.wire_radius and state.phase in (Phase.OUT, Phase.PRESSING):
            state.phase, state.tip = Phase.OUT, 0.0
            return np.zeros(3), np.zeros(3)
        if state.phase in (Phase.OUT, Phase.PRESSING):
            tip: Vector = rotation @ self._tip + origin
            force = self._press(rotation, tip, origin, over_pad=over_pad)
            if not state.count:
                lying, moment = self._skin_force(rotation, origin, 0, len(self._stations) - 1)
                return force + lying, moment + cross(tip, force)
        return self._follow(rotation, origin)

    def displaced(self) -> tuple[Vector, Vector]:
        """Return places in the tissue at rest and their displacements, both m, shape (n, 3), frame `pad`.

        At the last pose: the covered points of the channel, and the skin or tissue at the tip.
        """
        state = self.state
        if state.phase is Phase.OUT:
            return np.zeros((0, 3)), np.zeros((0, 3))
        if state.phase is Phase.PRESSING:
            return state.touched[None], self._stretch[None]
        if self._followed is None:
            return np.zeros((0, 3)), np.zeros((0, 3))
        rotation, local, away, weights = self._followed
        missing = local.copy()
        missing[:, :2] *= (1.0 - self._needle.radius / away)[:, None]
        displacements = -(weights[:, None] * missing) @ rotation.T
        if state.tip:
            displacements[-1] += max(0.0, state.length - state.cut) * (rotation @ self._forward)
        return state.points[: len(displacements)], displacements

    def _press(self, rotation: Vector, tip: Vector, origin: Vector, *, over_pad: bool) -> Vector:
        """Return the force of the unbroken skin on the tip, N; break the skin at too large a force."""
        state = self.state
        if tip[2] >= 0.0 or not over_pad:
            state.phase, state.tip = Phase.OUT, 0.0
            return np.zeros(3)
        if state.phase is Phase.OUT:
            state.phase, state.touched[:] = Phase.PRESSING, (tip[0], tip[1], 0.0)
        self._stretch = tip - state.touched
        force = -self._tissue.skin_stiffness * self._stretch
        state.tip = float(np.sqrt(force @ force))
        forward = rotation @ self._forward
        if -(force @ forward) > self._tissue.entry_puncture and forward[2] < 0.0:
            self._break_in(rotation, origin)
        return force

    def _break_in(self, rotation: Vector, origin: Vector) -> None:
        """Begin a channel where the wire now passes the skin."""
        state = self.state
        angle = self._skin_angle(rotation, origin, entering=True)
        state.phase, state.count, state.points[:] = Phase.IN, 1, 0.0
        state.points[0] = rotation @ self._needle.points(np.array([angle]))[0] + origin
        state.length = self._needle.radius * (self._needle.arc / 2.0 - angle)
        state.cut = max(0.0, state.length - self._tissue.give)
        state.slid = state.length
        self._extend_channel(rotation, origin)

    def _skin_angle(self, rotation: Vector, origin: Vector, *, entering: bool) -> float:
        """Return the angle on the wire, nearest to the tip, of the passage through the skin, in or out.

        The height of the wire is A cos(angle - b) + origin_z, falling near the tip at an entry.
        """
        along, across, _ = rotation[2].tolist()
        lift = max(self._needle.radius * hypot(along, across), 1e-12)
        half = acos(min(max(-float(origin[2]) / lift, -1.0), 1.0))
        end = self._needle.arc / 2.0
        angle = atan2(across, along) + (half if entering else -half)
        # of the turns of this angle that which is at most half a turn from the tip's
        return angle - 2.0 * pi * round((angle - end) / (2.0 * pi))

    def _extend_channel(self, rotation: Vector, origin: Vector) -> None:
        """Add points to the channel up to the cut end, along the present wire."""
        state = self.state
        while state.count < self._most and state.count * SPACING <= state.cut:
            behind = state.length - state.count * SPACING
            angle = np.array([self._needle.angle(behind)])
            state.points[state.count] = rotation @ self._needle.points(angle)[0] + origin
            state.count += 1

    def _follow(self, rotation: Vector, origin: Vector) -> tuple[Vector, Vector]:
        """Return force and moment of channel and tip, with the tip `length` along the channel.

        Summed in the needle's frame: a point is (p cos a, p sin a, z), and the force on the needle there is
        radial, along the arc, and normal to the arc's plane.
        """
        state, tissue, radius = self.state, self._tissue, self._needle.radius
        local = (state.points[: state.count] - origin).dot(rotation)
        x, y, z = local.T
        away = np.maximum(np.hypot(x, y), 1e-9)
        on_wire, weights = self._slide_tip(np.arctan2(y, x))
        if self._has_left(on_wire):
            return np.zeros(3), np.zeros(3)
        self._followed = rotation, local, away, weights
        missing = away - radius
        state.swept = float(weights.dot(np.hypot(missing, z))) * SPACING
        sums = np.empty((4, len(away)))
        sums[0] = weights
        np.multiply(weights, z, out=sums[1])
        np.multiply(weights, missing, out=sums[2])
        np.subtract(z * sums[2], away * sums[1], out=sums[3])
        directions = local.T[:2] / away
        (wx, zx, rx, mx), (wy, zy, ry, my) = directions.dot(sums.T).tolist()
        press, rub = tissue.compression * SPACING, self._channel_friction(state.covered)
        at_tip = self._resisting_force(rotation, origin)
        force = np.array([press * rx + rub * wy, press * ry - rub * wx, press * float(weights.dot(z))])
        moment = np.array([rub * zx - press * my, rub * zy + press * mx, -rub * float(weights.dot(away))])
        force -= at_tip * self._forward
        moment[2] -= at_tip * radius
        force, moment = rotation.dot(force), rotation.dot(moment)
        moment += cross(origin, force)
        lying, turning = self._skin_force(rotation, origin, *self._outside())
        return force + lying, moment + turning

    def _slide_tip(self, angles: Vector) -> tuple[Vector, Vector]:
        """Move the tip along the channel to the points at `angles` on the wire, rad.

        Returns the distance of each point behind the tip along the wire, m, and the covered share.
        """
        state, needle = self.state, self._needle
        ways, middle = self._arclengths[: state.count], needle.length / 2.0
        on_wire = state.length - ways  # by where the tip was; nearest to this by whole turns
        turned = angles - needle.arc / 2.0 + on_wire / needle.radius
        turned -= 2.0 * pi * np.rint(turned / (2.0 * pi))
        on_wire -= needle.radius * turned
        weights = np.abs(on_wire - middle)
        weights *= -1.0 / SPACING
        weights += middle / SPACING + 0.5
        np.maximum(np.minimum(weights, 1.0, out=weights), 0.0, out=weights)
        covered = float(weights.sum())
        if covered > 0.0:
            state.length = float(weights.dot(on_wire + ways)) / covered
        else:  # only the end of the wire, or only the tip, is near the channel
            nearest = int(np.argmin(np.abs(on_wire)))
            state.length = float(on_wire[nearest] + ways[nearest])
        state.covered = covered * SPACING
        return on_wire, weights

    def _channel_friction(self, covered: float) -> float:
        """Return the friction (N) at each covered point; let the wire slip at too large a friction."""
        state, largest = self.state, self._tissue.friction * SPACING
        stiffness = largest / self._tissue.give
        pull = stiffness * (state.length - state.slid)
        if abs(pull) > largest:
            pull = largest if pull > 0.0 else -largest
            state.slid = state.length - pull / stiffness
        return pull if covered > 0.0 else 0.0

    def _resisting_force(self, rotation: Vector, origin: Vector) -> float:
        """Return the force (N) against the tip: of cutting, or of stretching skin up to the break."""
        state, tissue, needle = self.state, self._tissue, self._needle
        ahead = state.length - state.cut
        if state.phase is Phase.THROUGH or ahead <= 0.0:
            state.tip = 0.0
            return 0.0
        stiffness = tissue.cutting / tissue.give
        to_skin = self._way_to_skin(rotation, origin)
        if ahead > tissue.give and to_skin > tissue.give:
            state.cut = state.length - min(ahead, tissue.give)
            self._extend_channel(rotation, origin)
            ahead = state.length - state.cut
        stretch = max(0.0, ahead - tissue.give)
        state.tip = stiffness * min(ahead, tissue.give) + tissue.skin_stiffness * stretch
        if stretch > 0.0 and state.tip > tissue.exit_puncture:
            state.phase, state.cut, state.tip = Phase.THROUGH, state.length + min(0.0, to_skin), 0.0
            self._extend_channel(rotation, origin)
            angle = np.array([needle.arc / 2.0 + to_skin / needle.radius])
            state.came_out[:] = rotation @ needle.points(angle)[0] + origin
        return state.tip

    def _way_to_skin(self, rotation: Vector, origin: Vector) -> float:
        """Return the distance along the arc from the tip to the exit, m; negative beyond."""
        angle = self._skin_angle(rotation, origin, entering=False)
        return self._needle.radius * (angle - self._needle.arc / 2.0)

    def _has_left(self, on_wire: Vector) -> bool:
        """Return whether the needle is out of its channel, at either end; then forget the channel."""
        state = self.state
        back, out = state.length <= 0.0, float(on_wire.min()) > self._needle.length + SPACING
        if back or out:
            state.pulled_out = out
            state.phase, state.count, state.covered, state.swept, state.tip = Phase.OUT, 0, 0.0, 0.0, 0.0
            state.length = state.cut = state.slid = 0.0
            self._followed = None
        return back or out

    def _outside(self) -> tuple[int, int]:
        """Return the stations of the wire behind the channel: from the base, count."""
        behind = self._needle.length - self.state.length
        return 0, max(0, int(behind / self._share) - 1)

    def _skin_force(self, rotation: Vector, origin: Vector, first: int, last: int) -> tuple[Vector, Vector]:
        """Return force and moment of the skin on the stations of the wire pressing from above."""
        force, moment, stations = np.zeros(3), np.zeros(3), self._stations[first:last]
        depth = self._needle.wire_radius - float(origin[2]) - stations.dot(rotation[2])
        if last > first and float(depth.max()) > 0.0:
            loads = self._tissue.surface * self._share * np.maximum(depth, 0.0)
            places = stations.dot(rotation.T) + origin
            force[2] = float(loads.sum())
            moment[0], moment[1] = float(places[:, 1] @ loads), -float(places[:, 0] @ loads)
        return force, moment
