"""The mirror: simulated arms follow the measured states of real ones, for overlays and for comparison.

Each new sample of a real arm becomes one `servo_jp`, with the velocity measured, clipped to the
simulated arm's ranges. An arm whose real one is silent holds. Two figures measure how well it follows:

    distance   from the simulated tip to the real one, both by the simulated arm's kinematics, m
    lag        the time by which the simulated arm is behind, s: over the last second it was where the real
               one is now, less `lag` times its velocity; lag = sum v.(q - q_sim) / sum v.v, joints weighted
               by their speed limits.

An arm that does not follow has neither, and one that follows without moving has no lag: nothing is published.

The age of the sample, by its way from the real arm to the hub, is not in it and adds to the lag.
"""

from __future__ import annotations

from math import exp
from typing import ClassVar, cast

import numpy as np
from pydantic import Field

from controllers.motion.params import Arms, EcmParams, PsmParams
from controllers.ports import measured_joints
from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    Value,
    array,
    event_in,
    event_out,
    flag,
    number,
)
from robots.dvrk import crtk
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.quantity import Duration
from schemas.ros import EmptyMessage, Float64Message, Header, JointState, StringMessage, Time
from schemas.vectors import Vector

__all__ = ["Mirror", "MirrorParams"]

_WINDOW = 1.0
"""s; time constant of the sums from which the lag is estimated."""
_LEAST = 1e-5
"""Sum of squares of velocities (shares of the speed limits, s) below which the lag is not estimated.

It is that of 0.3 % of the limits for a second.
"""


class MirrorParams(Params):
    """Which arms follow real ones."""

    open_to_pages: ClassVar[bool] = True

    arms: Arms
    max_age: Duration = Field(
        default=100_000_000, gt=0, description="an arm holds when its real one has been silent for longer"
    )


class Mirror(Controller):
    """Reads real arms under `real/` and their simulated ones; sends `servo_jp` to these.

    It also publishes `distance` and `lag`.
    """

    params_model: ClassVar[type[Params]] = MirrorParams
    params: MirrorParams

    def __init__(self, name: str, params: MirrorParams) -> None:
        super().__init__(name, params)
        self._arms = [_Arm(name, arm, params.max_age) for name, arm in params.arms.present_arms.items()]
        self.keep(*(arm.state for arm in self._arms))

    @property
    def ports(self) -> tuple[Port, ...]:
        """Per arm the real one's and the simulated one's states in, commands and figures out."""
        return tuple(port for arm in self._arms for port in arm.ports)

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start without a sample."""
        return {port: value for arm in self._arms for port, value in arm.outputs.items()}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Let every arm follow its newest sample."""
        return {port: value for arm in self._arms for port, value in arm.step(t, h, inputs).items()}


class _ArmState(Record):
    sample = array("n")
    """Positions sent last; NaN: none."""
    jaw_sample = array("jaw")
    sums = array(2)
    """v.(q - q_sim) and v.v, of which the lag is the ratio."""
    follows = flag()
    ready = flag(start=True)
    """Whether the simulated arm is ENABLED and homed."""
    distance = number()
    lag = number()


class _Arm:
    """An arm. All that lasts from step to step is in `state`."""

    def __init__(self, name: str, params: PsmParams | EcmParams, max_age_ns: int) -> None:
        self._name, self._chain, self._max_age_ns = name, params.chain, max_age_ns
        gripper = params.gripper
        self._jaw = gripper.joints[:1] if gripper is not None and gripper.name == "jaw" else ()
        self._range = self._chain.lower, self._chain.upper
        self._jaw_range = (
            np.array([joint.lower for joint in self._jaw]),
            np.array([joint.upper for joint in self._jaw]),
        )
        n, m = len(self._chain.joints), len(self._jaw)
        self.state = _ArmState(n=n, jaw=m)
        self._forget()
        self._silence: dict[str, Value] = {
            f"{name}/{out}": ()
            for out in ("servo_jp", "hold", "warning", "distance", "lag", *(("jaw/servo_jp",) if m else ()))
        }
        self.outputs = dict(self._silence)

    @property
    def ports(self) -> tuple[Port, ...]:
        name, names, age = self._name, tuple(joint.name for joint in self._chain.joints), self._max_age_ns
        command = "positions and velocities of each sample of the real arm"
        distance = "between the tips, at every step at which the simulated arm follows"
        lag = "by which the simulated arm is behind, at every step at which both move"
        jaw = f"real/{name}/jaw/measured_js"
        return (
            measured_joints(f"real/{name}/measured_js", names, "of the real arm", start=(), max_age_ns=age),
            measured_joints(f"{name}/measured_js", names, start=()),
            event_in(f"{name}/operating_state", OperatingState),
            event_out(f"{name}/servo_jp", JointState, command),
            event_out(f"{name}/hold", EmptyMessage, "when the real arm is silent"),
            event_out(f"{name}/warning", StringMessage, "why the arm holds"),
            event_out(f"{name}/distance", Float64Message, distance, unit="m"),
            event_out(f"{name}/lag", Float64Message, lag, unit="s"),
            *(
                (
                    measured_joints(jaw, ("jaw",), "of the real jaw", start=(), max_age_ns=age),
                    event_out(f"{name}/jaw/servo_jp", JointState),
                )
                if self._jaw
                else ()
            ),
        )

    def step(self, t: int, h: int, inputs: Inputs) -> dict[str, Value]:
        """Command the simulated arm to the newest sample, and compare the two."""
        name = self._name
        self.outputs |= self._silence
        for state in cast("tuple[OperatingState, ...]", inputs.events(f"{name}/operating_state")):
            self.state.ready = crtk.is_ready(state)
        n, real = len(self._chain.joints), inputs[f"real/{name}/measured_js"]
        fresh = not inputs.stale(f"real/{name}/measured_js")
        if self.state.follows and not fresh:
            self.outputs[f"{name}/hold"] = (EmptyMessage(),)
            text = f"{name} holds: its real arm has been silent for more than {self._max_age_ns / 1e6:g} ms"
            self.outputs[f"{name}/warning"] = (StringMessage(data=text),)
        self.state.follows = fresh and self.state.ready
        if self.state.follows:
            stamp = Time.from_ns(t + h)
            self._send("servo_jp", self.state.sample, real, self._range, stamp)
            if self._jaw and not inputs.stale(f"real/{name}/jaw/measured_js"):
                self._send(
                    "jaw/servo_jp",
                    self.state.jaw_sample,
                    inputs[f"real/{name}/jaw/measured_js"],
                    self._jaw_range,
                    stamp,
                )
            self._compare_tips(real[:n], real[n : 2 * n], inputs[f"{name}/measured_js"][:n], h * 1e-9)
        else:
            self._forget()
        return self.outputs

    def _forget(self) -> None:
        """Send the next sample in any case: NaN equals no position."""
        self.state.sample[:] = self.state.jaw_sample[:] = np.nan

    def _send(
        self, command: str, sample: Vector, real: Vector, allowed: tuple[Vector, Vector], stamp: Time
    ) -> None:
        """Send positions within what is `allowed`, and velocities, unless they are those of `sample`."""
        n = len(sample)
        if real[:n].tolist() == sample.tolist():
            return
        sample[:] = real[:n]
        within = np.clip(real[:n], *allowed)
        message = JointState(
            header=Header(stamp=stamp),
            position=within,
            velocity=np.where(within == real[:n], real[n : 2 * n], 0.0),
        )
        self.outputs[f"{self._name}/{command}"] = (message,)

    def _compare_tips(self, real: Vector, velocity: Vector, simulated: Vector, h: float) -> None:
        tips = self._chain.forward(np.array([real, simulated]))[:, :3, 3]
        self.state.distance = float(np.linalg.norm(tips[0] - tips[1]))
        self.outputs[f"{self._name}/distance"] = (Float64Message(data=self.state.distance),)
        speed = velocity / self._chain.velocity
        sums = self.state.sums
        sums *= exp(-h / _WINDOW)
        sums += h * (speed @ ((real - simulated) / self._chain.velocity)), h * (speed @ speed)
        error, square = sums.tolist()
        if square > _LEAST:
            self.state.lag = error / square
            self.outputs[f"{self._name}/lag"] = (Float64Message(data=self.state.lag),)
