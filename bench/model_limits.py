"""What the robot's model is not true to: speeds of a jaw, drift of a free arm, fingers in one another.

Results: docs/decisions/0088-limits-of-the-model.md. Simulated time alone counts, so the figures are the same
on every machine.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from engines.mujoco.arms.friction import Friction
from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import Inputs, Setup
from robots.dvrk.mounted.mounted_psm import MountedPsm
from schemas.vectors import Vector

PERIOD_NS = 1_000_000
FRONT = {"PSM1": {"instrument": "400006"}}


class Arm:
    """PSM1 with a needle driver, stepped by hand."""

    def __init__(self) -> None:
        self.engine = MujocoEngine("robot", MujocoParams.model_validate({"arms": FRONT, "looks": False}))
        self.outputs = dict(self.engine.configure(Setup(PERIOD_NS, Path(), {})))
        ports = [port for port in self.engine.ports if port.causality == "input" and port.start is not None]
        self.inputs = Inputs({port.name: np.array(port.start, float) for port in ports})
        self._t = 0

    def steps(self, seconds: float, jaw: Callable[[float], float] | None = None) -> Vector:
        """Return the jaw's positions and velocities of every step, shape (n, 2); `jaw` commands it."""
        found: list[Vector] = []
        for i in range(round(seconds * 1e9 / PERIOD_NS)):
            if jaw is not None:
                self.inputs["PSM1/jaw/servo_jp"][:] = jaw((i + 1) * PERIOD_NS * 1e-9)
            self.outputs |= self.engine.step(self._t, PERIOD_NS, self.inputs)
            self._t += PERIOD_NS
            found.append(self.outputs["PSM1/jaw/measured_js"][:2].copy())
        return np.array(found)

    @property
    def params(self) -> MountedPsm:
        """Of the arm."""
        params = self.engine.params.arms["PSM1"]
        assert isinstance(params, MountedPsm)
        return params


def jaw_speed(seconds: float) -> dict[str, float]:
    """Open the jaw by 1 rad, along a minimum-jerk curve or, in no time, at once."""

    def command(t: float) -> float:
        s = min(t / seconds, 1.0) if seconds else 1.0
        return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)

    arm = Arm()
    speed = np.abs(arm.steps(0.4, command)[:, 1])
    jaw = arm.params.tool.jaw
    assert jaw is not None
    return {
        "limit_rad_s": jaw.velocity,
        "peak_rad_s": float(speed.max()),
        "above_the_limit_ms": float((speed > jaw.velocity).sum() * PERIOD_NS * 1e-6),
    }


def drift(*, dry: bool) -> dict[str, float]:
    """Let the arm go at home for 2 s, without and with friction that holds; speeds in the last second."""
    set_friction = Friction.set
    if not dry:
        Friction.set = lambda self, dry: set_friction(self, dry=False)  # noqa: ARG005
    try:
        arm = Arm()
        arm.inputs["PSM1/control_mode"][:] = 2.0
        arm.steps(1.0)
        roll, tip = _where(arm)
        arm.steps(1.0)
    finally:
        Friction.set = set_friction
    then_roll, then_tip = _where(arm)
    return {
        "roll_rad_s": abs(then_roll - roll),
        "tip_mm_s": float(np.linalg.norm(then_tip - tip)) * 1e3,
    }


def _where(arm: Arm) -> tuple[float, Vector]:
    return float(arm.outputs["PSM1/measured_js"][3]), arm.outputs["PSM1/measured_cp"][:3].copy()


def overlap() -> dict[str, float]:
    """Close the jaw on nothing, as far as it goes."""
    arm = Arm()
    jaw = arm.params.tool.jaw
    assert jaw is not None
    at = float(arm.steps(0.6, lambda _: jaw.lower)[-1, 0])
    return {"jaw_rad": at, "each_tip_beyond_the_middle_mm": float(jaw.length * np.sin(-at / 2.0)) * 1e3}


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", action="store_true")
    figures: dict[str, Any] = {
        "jaw, command at once": jaw_speed(0.0),
        "jaw, minimum jerk in 0.2 s": jaw_speed(0.2),
        "free arm, friction as under the servo": drift(dry=False),
        "free arm": drift(dry=True),
        "jaw closed on nothing": overlap(),
    }
    if parser.parse_args().json:
        print(json.dumps(figures, indent=2))
        return
    for name, row in figures.items():
        print(f"{name:40}", "  ".join(f"{key} {value:.4g}" for key, value in row.items()))


if __name__ == "__main__":
    main()
