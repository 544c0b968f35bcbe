"""The mirror: simulated arms follow the measured states of real ones, for overlays and for comparison, and
show how far behind they are.

Each new sample of a real arm becomes one `servo_jp`, with the velocity that was measured, clipped to the
simulated arm's ranges. An arm that is not heard any more holds. Two figures tell how well it follows:

    distance   from the simulated tip to the real one, both by the simulated arm's kinematics, m
    lag        the time by which the simulated arm is behind: over the last second it was where the real one
    is now less `lag` times its velocity,
               lag = sum v.(q - q_sim) / sum v.v, joints weighed by their speed limits; where nothing moves it
               stays.

The way from the real arm to the hub is not in it: the sample's own age adds to the lag.
"""

from __future__ import annotations

from math import exp
from typing import ClassVar, cast

import numpy as np
from pydantic import Field

from controllers.motion.params import Arms, EcmParams, PsmParams
from hub.participant import Inputs, Outputs, Params, Setup, Stepped, Value, restore_arrays, state_hash
from robots.serial_chain import Joint
from schemas.crtk import OperatingState
from schemas.ports import Port
from schemas.quantity import Duration
from schemas.ros import EmptyMessage, Header, JointState, StringMessage, Time
from schemas.vectors import Vector

__all__ = ["Mirror", "MirrorParams"]

_JOINT_STATE, _NUMBER = "sensor_msgs/msg/JointState", "std_msgs/msg/Float64"
_WINDOW = 1.0
"""s; time constant with which the past is forgotten where the lag is estimated."""
_LEAST = 1e-5
"""Sum of squares of velocities (shares of the speed limits, s) below which nothing is known of the lag: 0.3 %
of the limits for a second.
"""


class MirrorParams(Params):
    """Which arms follow real ones."""

    arms: Arms
    max_age: Duration = Field(
        default=100_000_000, gt=0, description="an arm holds when its real one has been silent for longer"
    )


class Mirror(Stepped):
    """Real arms in under `real/`, their simulated ones' states too; `servo_jp` to these out, with `distance`
    and `lag`.
    """

    params_model: ClassVar[type[Params]] = MirrorParams
    params: MirrorParams

    def __init__(self, name: str, params: MirrorParams) -> None:
        """Take the participant's name and its parameters."""
        super().__init__(name, params)
        self._arms = [_Arm(name, arm, params.max_age) for name, arm in params.arms.driven.items()]

    @property
    def ports(self) -> tuple[Port, ...]:
        """Per arm the real one's and the simulated one's states in, commands and figures out."""
        return tuple(port for arm in self._arms for port in arm.ports)

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Start with nothing heard."""
        return {port: value for arm in self._arms for port, value in arm.outputs.items()}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Let every arm follow what is new."""
        return {port: value for arm in self._arms for port, value in arm.step(t, h, inputs).items()}

    def state_hash(self) -> int:
        """Return the hash of what was heard last, and of the figures."""
        return state_hash(*(arm.state for arm in self._arms))

    def save(self) -> bytes:
        """Return what is hashed."""
        return b"".join(arm.state.tobytes() for arm in self._arms)

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if it has the wrong size."""
        restore_arrays(self.name, (arm.state for arm in self._arms), state)

    def close(self) -> None:
        """Nothing is held."""


class _Arm:
    """One arm. All that changes is in `state`."""

    def __init__(self, name: str, params: PsmParams | EcmParams, max_age_ns: int) -> None:
        self._name, self._chain, self._max_age_ns = name, params.chain, max_age_ns
        gripper = params.gripper
        self._jaw = gripper.joints[:1] if gripper is not None and gripper.name == "jaw" else ()
        n, m = len(self._chain.joints), len(self._jaw)
        self.state = np.zeros(n + m + 6)
        parts = np.split(self.state, [n, n + m, n + m + 2, n + m + 3, n + m + 4, n + m + 5])
        self._heard, self._heard_jaw, self._sums, self._follows, self._ready, self._distance, self._lag = (
            parts
        )
        self._heard[:] = np.nan  # a state hash takes bits, so nothing heard is as good as any number
        self._heard_jaw[:] = np.nan
        self._ready[0] = 1.0
        self.outputs: dict[str, Value] = {
            f"{name}/{out}": () for out in ("servo_jp", "hold", "warning", *(("jaw/servo_jp",) if m else ()))
        }
        self.outputs |= {f"{name}/distance": self._distance, f"{name}/lag": self._lag}

    @property
    def ports(self) -> tuple[Port, ...]:
        name, names, fields = (
            self._name,
            tuple(joint.name for joint in self._chain.joints),
            ("position", "velocity", "effort"),
        )
        still = (0.0,) * (3 * len(names))
        real = {"causality": "input", "type": _JOINT_STATE, "fields": fields, "max_age_ns": self._max_age_ns}
        command = {"causality": "output", "type": _JOINT_STATE, "variability": "event"}
        rows = [
            {
                "name": f"real/{name}/measured_js",
                "names": names,
                "start": still,
                "description": "of the real arm",
            }
            | real,
            {
                "name": f"{name}/measured_js",
                "names": names,
                "start": still,
                "causality": "input",
                "type": _JOINT_STATE,
                "fields": fields,
            },
            {
                "name": f"{name}/operating_state",
                "causality": "input",
                "type": OperatingState.ros_type,
                "variability": "event",
            },
            {
                "name": f"{name}/servo_jp",
                "description": "where the real arm is, as fast as it goes, whenever it tells",
            }
            | command,
            {
                "name": f"{name}/hold",
                "causality": "output",
                "type": "std_msgs/msg/Empty",
                "variability": "event",
                "description": "when it is silent",
            },
            {
                "name": f"{name}/warning",
                "causality": "output",
                "type": "std_msgs/msg/String",
                "variability": "event",
                "description": "why the arm holds",
            },
            {
                "name": f"{name}/distance",
                "causality": "output",
                "type": _NUMBER,
                "unit": "m",
                "description": "between the tips",
            },
            {
                "name": f"{name}/lag",
                "causality": "output",
                "type": _NUMBER,
                "unit": "s",
                "description": "by which the simulated arm is behind",
            },
        ]
        if self._jaw:
            start = (0.0, 0.0, 0.0)
            rows.append(
                {
                    "name": f"real/{name}/jaw/measured_js",
                    "names": ("jaw",),
                    "start": start,
                    "description": "of the real jaw",
                }
                | real
            )
            rows.append({"name": f"{name}/jaw/servo_jp"} | command)
        return tuple(Port.model_validate(row) for row in rows)

    def step(self, t: int, h: int, inputs: Inputs) -> dict[str, Value]:
        """Tell the simulated arm what is new of the real one, and how far they are apart."""
        name = self._name
        self.outputs.update({f"{name}/servo_jp": (), f"{name}/hold": (), f"{name}/warning": ()})
        if self._jaw:
            self.outputs[f"{name}/jaw/servo_jp"] = ()
        for state in cast("tuple[OperatingState, ...]", inputs.events(f"{name}/operating_state")):
            self._ready[0] = state.state == "ENABLED" and state.is_homed
        n, real = len(self._heard), inputs[f"real/{name}/measured_js"]
        heard = not inputs.stale(f"real/{name}/measured_js")
        if self._follows[0] and not heard:
            self.outputs[f"{name}/hold"] = (EmptyMessage(),)
            text = f"{name} holds: its real arm has been silent for more than {self._max_age_ns / 1e6:g} ms"
            self.outputs[f"{name}/warning"] = (StringMessage(data=text),)
        self._follows[0] = heard and self._ready[0]
        if self._follows[0]:
            stamp = Time.from_ns(t + h)
            self._tell("servo_jp", self._heard, real, self._chain.joints, stamp)
            if self._jaw and not inputs.stale(f"real/{name}/jaw/measured_js"):
                self._tell(
                    "jaw/servo_jp", self._heard_jaw, inputs[f"real/{name}/jaw/measured_js"], self._jaw, stamp
                )
            self._compare(real[:n], real[n : 2 * n], inputs[f"{name}/measured_js"][:n], h * 1e-9)
        else:
            self._heard[:] = self._heard_jaw[:] = np.nan  # so that it is told anew
        return self.outputs

    def _tell(
        self, command: str, heard: Vector, real: Vector, joints: tuple[Joint, ...], stamp: Time
    ) -> None:
        """Send positions, with velocities, of a sample that is new."""
        n = len(joints)
        if np.array_equal(real[:n], heard):
            return
        heard[:] = real[:n]
        lower, upper = (np.array([getattr(joint, end) for joint in joints]) for end in ("lower", "upper"))
        within = np.clip(real[:n], lower, upper)
        message = JointState(
            header=Header(stamp=stamp),
            position=within,
            velocity=np.where(within == real[:n], real[n : 2 * n], 0.0),
        )
        self.outputs[f"{self._name}/{command}"] = (message,)

    def _compare(self, real: Vector, velocity: Vector, simulated: Vector, h: float) -> None:
        tips = [self._chain.forward(positions)[:3, 3] for positions in (real, simulated)]
        self._distance[0] = np.linalg.norm(tips[0] - tips[1])
        speed = velocity / self._chain.velocity
        self._sums *= exp(-h / _WINDOW)
        self._sums += h * (speed @ ((real - simulated) / self._chain.velocity)), h * (speed @ speed)
        if self._sums[1] > _LEAST:
            self._lag[0] = self._sums[0] / self._sums[1]
