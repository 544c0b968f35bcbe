"""The suturing pad as a participant: the force side of a bond at a needle, events, and the skin."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from engines.suture_pad.channel import Channel, Phase
from engines.suture_pad.drawn_thread import DrawnThread
from engines.suture_pad.params import SuturePadParams
from engines.suture_pad.ports import BOND, SKIN, THREAD_NUMBERS, bond_side, pad_ports
from engines.suture_pad.skin import Skin
from engines.suture_pad.three_points import ThreePoints
from hub.participant import (
    ForceSide,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    Stepped,
    array,
    number,
    restore_arrays,
    state_hash,
)
from robots.training.threads import THREAD
from robots.transform import inverse_transform
from robots.vector3 import cross
from schemas.errors import ScenarioError
from schemas.ports import BondSide, Port
from schemas.ros import Header, Time
from schemas.trocar_msgs import SoftBodyState, TaskEvent
from schemas.vectors import Vector

__all__ = ["SuturePad"]

_NEAR = 5.0e-3
"""Distance from a hole, in the plane of the hole, for an event to name the hole, m."""
_NO_TRIANGLES = np.zeros((0, 3), np.uint32)


class PadState(Record):
    """State of the pad beside the channel."""

    entry = array(3)
    exit = array(3)
    """Where the needle went in and out last, m, in the world."""
    stitches = array(1)
    tip_force = number()
    """At the end of the last step, N."""


class SuturePad(Stepped):
    """Soft tissue for a needle and its thread."""

    params_model: ClassVar[type[Params]] = SuturePadParams
    params: SuturePadParams

    def __init__(self, name: str, params: SuturePadParams) -> None:
        super().__init__(name, params)
        self._pad_in_world = params.phantom.pose
        self._world_in_pad = inverse_transform(self._pad_in_world)
        self._thing, needle = params.needle
        self._shape = needle.shape
        self._channel = Channel(self._shape, params.tissue)
        self._frame_of = ThreePoints(self._shape.bond_points)
        self._tip_in_needle = self._shape.marks[2]
        self._state = PadState()
        self._side: ForceSide | None = None
        self._thread = None
        if needle.thread is not None:
            depth = params.phantom.measures.skin[2]
            self._thread = DrawnThread(needle.thread, self._shape, params.tissue, depth)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Events of tissue and needle, and the skin."""
        return pad_ports(self.params.node_period, thread=self._thread is not None)

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        """The needle, with the force of the thread."""
        return (bond_side(),)

    def configure(self, setup: Setup) -> Outputs:
        """Prepare the skin.

        Raises ScenarioError where a period does not fit, or no needle is bonded.
        """
        params, where = self.params, f"participant '{self.name}'"
        if setup.period_ns % params.timestep:
            raise ScenarioError(
                f"{where}: timestep {params.timestep} ns does not divide the period {setup.period_ns} ns"
            )
        if params.node_period % setup.period_ns:
            raise ScenarioError(
                f"{where}: node_period {params.node_period} ns is no multiple of the period"
                f" {setup.period_ns} ns"
            )
        phantom = params.phantom.measures
        self._holes, self._names = phantom.holes, phantom.names
        self._half = phantom.skin[0] / 2.0, phantom.skin[1] / 2.0
        self._skin = Skin(phantom.skin, phantom.holes[:, :3, 3])
        if plan := setup.bonds.get(BOND):
            self._side = ForceSide(bond_side(), plan)
        numbers = ["phase", "insertion", "depth", "resistance", "tip_force", "trauma"]
        if self._thread is not None:
            numbers += THREAD_NUMBERS
        self._numbers = {name: np.zeros(1) for name in numbers}
        self._outputs: dict[str, Any] = {
            **self._numbers,
            "stitches": self._state.stitches,
            "entry": self._state.entry,
            "exit": self._state.exit,
            "events": (),
            **self._drawn_bodies(0),
        }
        if self._side is not None:
            still = {self._side.force_port: np.zeros(9), self._side.work_port: np.zeros(1)}
            self._outputs |= still
        return self._outputs

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Follow the predicted needle, and return the reaction."""
        outputs, side = self._outputs, self._side
        outputs["events"] = ()
        for body in (SKIN, THREAD):
            outputs.pop(f"{body}/nodes", None)
        if side is not None:
            was = self._channel.state.phase
            outputs |= self._react_to_needle(side, inputs, h)
            if self._channel.state.phase is not was:
                outputs["events"] = self._events(was, t + h)
            self._report()
        if not (t + h) % self.params.node_period:
            outputs |= self._drawn_bodies(t + h)
        return outputs

    def _react_to_needle(self, side: ForceSide, inputs: Inputs, h: int) -> dict[str, Vector]:
        """Take the sub-steps of a step, and return the reaction."""
        side.begin(inputs, h * 1e-9)
        dt, no_damper, pushed = self.params.timestep * 1e-9, np.zeros(9), np.zeros(9)
        for i in range(h // self.params.timestep):
            tau = (i + 0.5) * dt
            pushed = self._push(side.position(tau))
            side.add(pushed, no_damper, tau, dt)
        self._numbers["resistance"][0] = self._size
        if self._thread is not None:
            pull, count = self._thread.pull, self._thread.count
            self._numbers["thread_pull"][0], self._numbers["passages"][0] = pull, count
        return side.result(pushed, no_damper)

    def _push(self, position: Vector) -> Vector:
        """Return the needle's forces (N) on the pad at three points (m), both in the world, shape (9,)."""
        rotation, shift = self._world_in_pad[:3, :3], self._world_in_pad[:3, 3]
        points = position.reshape(3, 3).dot(rotation.T) + shift
        turned, origin = self._frame_of.frame(points)
        x, y, _ = (turned.dot(self._tip_in_needle) + origin).tolist()
        over = abs(x) < self._half[0] and abs(y) < self._half[1]
        force, moment = self._channel.advance(turned, origin, over_pad=over)
        self._size = float(np.sqrt(force @ force))
        if self._thread is not None:
            pull, place = self._thread.follow(turned, origin, self._channel.state)
            force, moment = force + pull, moment + cross(place, pull)
        if not (force.any() or moment.any()):
            return np.zeros(9)
        return self._frame_of.forces(points, -force, -moment).dot(rotation).ravel()

    def _report(self) -> None:
        channel, numbers = self._channel.state, self._numbers
        numbers["phase"][0], numbers["insertion"][0] = channel.phase, channel.length
        numbers["tip_force"][0], numbers["trauma"][0] = channel.tip, channel.swept
        lowest = channel.points[: channel.count, 2].min() if channel.count else 0.0
        numbers["depth"][0] = max(0.0, -float(lowest))
        self._state.tip_force = channel.tip

    def _events(self, was: Phase, time_ns: int) -> tuple[TaskEvent, ...]:
        """Return the events of a change of phase, and store the needle's entry or exit."""
        channel, state = self._channel.state, self._state
        names = {
            (Phase.PRESSING, Phase.IN): ("entered", state.entry, channel.points[0]),
            (Phase.IN, Phase.THROUGH): ("exited", state.exit, channel.came_out),
            (Phase.IN, Phase.OUT): ("withdrawn", state.entry, None),
            (Phase.THROUGH, Phase.OUT): ("withdrawn", state.exit, None),
        }
        if (was, channel.phase) not in names:
            return ()
        event, place, point = names[was, channel.phase]
        if point is not None:
            place[:] = self._pad_in_world[:3, :3] @ point + self._pad_in_world[:3, 3]
        elif channel.pulled_out:
            event = "pulled out"
            state.stitches[0] += 1.0
        return (
            TaskEvent(
                header=Header(stamp=Time.from_ns(time_ns), frame_id="world"),
                event=event,
                object=self._thing,
                place=self._nearest_hole(place, "entry" if event in ("entered", "withdrawn") else "exit"),
                value=state.tip_force,
                unit="N",
            ),
        )

    def _nearest_hole(self, place: Vector, kind: str) -> str:
        """Return the name of the hole of a kind nearest to `place` (m, world); empty: none is near."""
        here = self._world_in_pad[:3, :3] @ place + self._world_in_pad[:3, 3]
        away = np.linalg.norm(self._holes[:, :3, 3] - here, axis=1)
        away[[not name.startswith(kind) for name in self._names]] = np.inf
        nearest = int(away.argmin())
        return self._names[nearest] if away[nearest] <= _NEAR else ""

    def _drawn_bodies(self, time_ns: int) -> dict[str, SoftBodyState]:
        """Return skin and thread; the thread settles over the time since the last drawing."""
        first, thread = time_ns == 0, self._thread
        skin = self._skin.displaced(*self._channel.displaced())
        shown = {SKIN: (skin, self._skin.triangles if first else _NO_TRIANGLES)}
        if thread is not None:
            if not first and self._side is not None:
                thread.settle(self.params.node_period * 1e-9)
            shown[THREAD] = thread.tube(), thread.triangles() if first else _NO_TRIANGLES
        rotation, shift = self._pad_in_world[:3, :3], self._pad_in_world[:3, 3]
        return {
            f"{body}/nodes": SoftBodyState(
                header=Header(stamp=Time.from_ns(time_ns), frame_id="world"),
                body=body,
                nodes_m=(nodes @ rotation.T + shift).astype(np.float32).ravel(),
                triangles=triangles.ravel(),
            )
            for body, (nodes, triangles) in shown.items()
        }

    def _parts(self) -> tuple[Vector, ...]:
        side = () if self._side is None else (self._side.state,)
        thread = () if self._thread is None else self._thread.parts
        return (self._state.values, self._channel.state.values, *side, *thread)

    def state_hash(self) -> int:
        """Return 64 bits of channel, pad state, and bond."""
        return state_hash(*self._parts())

    def save(self) -> bytes:
        """Return channel, pad state, and bond."""
        return b"".join(part.tobytes() for part in self._parts())

    def restore(self, state: bytes) -> None:
        """Return to a saved state, bit for bit. Raises StateError for a state of another size."""
        parts = [part.copy() for part in self._parts()]
        restore_arrays(self.name, parts, state)
        self._channel.state.check(parts[1])
        self._state.values[:], self._channel.state.values[:] = parts[0], parts[1]
        if self._side is not None:
            self._side.state = parts[2]
        if self._thread is not None:
            self._thread.restore(parts[2 + (self._side is not None) :])

    def close(self) -> None:
        """Do nothing: there is nothing to give back."""
