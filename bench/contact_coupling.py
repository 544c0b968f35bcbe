"""Coupling algorithms on contact: the largest stable communication step, the force error, the energy made.

A MuJoCo tool with position servos presses, taps or strokes a block in Bullet (sub-steps of 0.5 ms) through a
bond, both engines in one process. A step counts as stable if the run ends, the force error stays below 30 %
and, where the tool is still, the force ripples by less than 0.05 N; the largest stable step is the largest
below which all tried ones are stable. The error is the RMS difference of the force, averaged over the step,
to a run by `impulse` at 0.25 ms, as a share of the RMS force. Results:
docs/decisions/0020-coupling-on-contact.md.
"""

from __future__ import annotations

import argparse
import json
import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from engines.bullet.engine import BulletEngine
from engines.bullet.params import BulletParams
from hub.participant import Inputs, MotionSide, Outputs, Params, Setup, Stepped, state_hash
from hub.testing import run_in_process
from schemas.errors import TrocarError
from schemas.ports import BondSide

ALGORITHMS: dict[str, dict[str, Any]] = {
    "jacobi": {"algorithm": "jacobi"},
    "gauss-seidel, tissue first": {"algorithm": "gauss-seidel", "order": ["tissue", "tool"]},
    "impulse": {"algorithm": "impulse"},
    "impulse, slope": {"algorithm": "impulse", "prediction": "slope"},
    "impulse-linearised": {"algorithm": "impulse-linearised"},
}
STEPS_MS = (1, 2, 4, 5, 8, 10, 16, 20)
ERROR_STEP_MS = 5
REFERENCE_MS = 0.25
START_M = 6e-3
RADIUS_M = 5e-3
SLIDER = """
<body><joint name="z" type="slide" axis="0 0 1" damping="{damping}"/>
<geom size=".005" mass="{mass}"/><site name="tip"/></body>"""
ARM = """
<body pos="-.149 0 0"><joint name="a" type="hinge" axis="0 -1 0" damping="{damping}"/>
<geom type="capsule" fromto="0 0 0 .12 0 0" size=".004" mass="{mass}"/>
<body pos=".12 0 0"><joint name="b" type="hinge" axis="0 -1 0" damping="{damping}"/>
<geom type="capsule" fromto="0 0 0 .12 0 0" size=".004" mass="{mass}"/>
<geom pos=".12 0 0" size=".005" mass=".015"/><site name="tip" pos=".12 0 0"/></body></body>"""
ROD = """
<body pos="0 0 .06"><joint name="x" type="slide" axis="1 0 0" damping="{damping}"/>
<joint name="y" type="slide" axis="0 1 0" damping="{damping}"/>
<joint name="z" type="slide" axis="0 0 1" damping="{damping}"/>
<joint name="turn" type="ball" stiffness="1" damping=".002"/>
<geom type="capsule" fromto="0 0 0 0 0 -.06" size=".004" mass="{mass}"/>
<site name="tip" pos="0 0 -.06"/></body>"""


def press(t: float) -> float:
    """Return the target height (m) of a press at `t` (s): 8 mm down in 0.3 s, held, and up again."""
    return START_M - 8e-3 * (
        min(max(t - 0.05, 0.0) / 0.3, 1.0) if t < 0.75 else max(1.0 - (t - 0.75) / 0.3, 0.0)
    )


def tap(t: float) -> float:
    """Return the height (m) of taps at 4 Hz that leave the tissue each time, up to 0.2 m/s."""
    return START_M + min(t / 0.1, 1.0) * (-1e-3 + 8e-3 * math.sin(8.0 * math.pi * t))


@dataclass(frozen=True)
class Case:
    """A tool, its task, and the tissue and virtual coupling it meets; SI units."""

    probe_stiffness: float
    mass: float
    servo: float
    servo_damping: float
    damping: float
    young_modulus: float = 10e3
    body: str = SLIDER
    height: Callable[[float], float] = press
    stroke: float = 0.0
    delay: float = 0.0
    duration: float = 1.2
    holds: tuple[float, float] | None = (0.55, 0.75)


CASES = {
    "50 g, k 500": Case(500, 0.05, 400, 4, 0.5),
    "50 g, k 2000, 30 kPa, light damping": Case(2000, 0.05, 400, 0.5, 0.05, 30e3),
    "10 g, k 500": Case(500, 0.01, 200, 0.2, 0.02),
    "20 g, k 5000, 30 kPa": Case(5000, 0.02, 400, 0.5, 0.05, 30e3),
    "tapping, 50 g, k 500": Case(500, 0.05, 400, 4, 0.5, height=tap, holds=None),
    "150 g in a hand": Case(2000, 0.15, 200, 0, 4, 30e3),
    "150 g in a hand, 5 ms late": Case(2000, 0.15, 200, 0, 4, 30e3, delay=5e-3),
    "two joints, 37 g at the tip": Case(2000, 0.03, 6, 0.05, 0.002, 30e3, body=ARM),
    "six degrees of freedom, stroking": Case(2000, 0.05, 400, 2, 0.2, 30e3, body=ROD, stroke=6e-3),
}


@dataclass
class Log:
    """What a run showed."""

    force: list[float] = field(default_factory=list[float])
    energy_made_j: float = math.nan
    whole: bool = False


class Tool(Stepped):
    """A tool on position servos, with its tip as the motion side of a bond."""

    params_model = Params
    ports = ()

    def __init__(self, case: Case, step_s: float, log: Log) -> None:
        """Build the tool for communication steps of `step_s` seconds."""
        super().__init__("tool", Params())
        self.case, self.log = case, log
        names = [name for name in "xyzab" if f'name="{name}"' in case.body]
        servos = "".join(
            f'<position joint="{name}" kp="{case.servo}" kv="{case.servo_damping}"/>' for name in names
        )
        body = case.body.format(mass=case.mass, damping=case.damping)
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><compiler angle="radian"/><option timestep="{min(5e-4, step_s)}" gravity="0 0 0"'
            ' integrator="implicitfast"/><default><geom contype="0"'
            ' conaffinity="0"/></default><worldbody><body pos="0.001 0.0007'
            f' {START_M}">{body}</body></worldbody><actuator>{servos}</actuator></mujoco>'
        )
        self.data = mujoco.MjData(self.model)
        self.site = self.model.site("tip").id
        if case.body is ARM:
            self.data.qpos[:] = 0.9, -1.8
        mujoco.mj_forward(self.model, self.data)
        self.start = self.data.site_xpos[self.site].copy()
        self.waiting = [np.zeros(6)] * round(case.delay / self.model.opt.timestep)

    @property
    def bonds(self) -> tuple[BondSide, ...]:
        """The tip, with the least effective mass in any direction it can move in."""
        jacobian, inertia = self.jacobian(), np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, inertia)
        mobility = jacobian[:3] @ np.linalg.solve(inertia, jacobian[:3].T)
        return (
            BondSide(
                name="probe",
                side="motion",
                frame="world",
                effective_mass=float(1.0 / np.linalg.eigvalsh(mobility)[-1]),
            ),
        )

    def jacobian(self) -> np.ndarray:
        """Return the Jacobian of the tip (linear, angular), shape (6, nv)."""
        rows = np.zeros((6, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, rows[:3], rows[3:], self.site)
        return rows

    def motion(self) -> tuple[np.ndarray, np.ndarray]:
        """Return pose (x, y, z, qx, qy, qz, qw) and twist (linear, angular) of the tip."""
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, self.data.site_xmat[self.site])
        return (
            np.concatenate([self.data.site_xpos[self.site], quaternion[[1, 2, 3, 0]]]),
            self.jacobian() @ self.data.qvel,
        )

    def configure(self, setup: Setup) -> Outputs:
        """Take the bond's plan."""
        self.side = MotionSide(self.bonds[0], setup.bonds["probe"])
        return self.side.result(*self.motion())

    def target(self, t: float) -> np.ndarray:
        """Return the servos' goals at `t` (s)."""
        case = self.case
        if case.body is SLIDER:
            return np.array([case.height(t) - START_M])
        if case.body is ROD:
            turn = 2.0 * math.pi * max(t - 0.3, 0.0)
            return np.array(
                [case.stroke * math.sin(turn), case.stroke * (1.0 - math.cos(turn)), case.height(t) - START_M]
            )
        # of the tip from the first joint, in the plane of the arm
        reach = np.array([2 * 0.12 * math.cos(0.9), case.height(t) - START_M])
        elbow = -math.acos(np.clip(reach @ reach / (2.0 * 0.12**2) - 1.0, -1.0, 1.0))
        return np.array([math.atan2(reach[1], reach[0]) - elbow / 2.0, elbow])

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Move under the servos and the reaction, which comes `delay` late."""
        pose, twist = self.motion()
        self.side.begin(inputs, pose, twist)
        dt, summed = self.model.opt.timestep, 0.0
        count = round(h * 1e-9 / dt)
        for i in range(count):
            self.waiting.append(self.side.force(i * dt, pose, twist))
            force, before = self.waiting.pop(0), pose
            self.data.ctrl[:] = self.target(t * 1e-9 + i * dt)
            self.data.qfrc_applied[:] = self.jacobian().T @ force
            mujoco.mj_step(self.model, self.data)
            mujoco.mj_forward(self.model, self.data)
            pose, twist = self.motion()
            # the tissue turns nothing
            self.side.add(force, np.concatenate([pose[:3] - before[:3], np.zeros(3)]))
            summed += force[2]
        self.log.force.append(summed / count)
        return self.side.result(pose, twist)

    def state_hash(self) -> int:
        """Return the hash of position and velocity."""
        return state_hash(self.data.qpos, self.data.qvel)

    def close(self) -> None:
        """Nothing is held."""


def simulate(case: Case, coupling: Mapping[str, Any], step_ms: float) -> Log:
    """Run a case; a run that does not end well is not `whole`."""
    log = Log()
    step_s = step_ms * 1e-3
    tissue = BulletParams.model_validate(
        {
            "organs": {
                "block": {"size": [0.08, 0.06, 0.02], "young_modulus": case.young_modulus, "nodes": 75}
            },
            "probes": {"probe": {"radius": RADIUS_M, "mass": 0.02, "stiffness": case.probe_stiffness}},
            "sub_grid": False,
            "timestep": min(5e-4, step_s),
            "node_period": 16 * step_s,
        }
    )
    scenario = {
        "name": "contact",
        "step": step_s,
        "duration": round(case.duration / step_s) * step_s,
        "bonds": [{"motion": "tool.probe", "force": "tissue.probe", "check": "warn", **coupling}],
    }
    try:
        summary = run_in_process(
            scenario, {"tool": Tool(case, step_s, log), "tissue": BulletEngine("tissue", tissue)}
        )
    except TrocarError:
        return log
    log.energy_made_j, log.whole = summary.energy_residual_j, True
    return log


def error(case: Case, log: Log, step_ms: float, reference: Log) -> float | None:
    """Return the force error as a share, or None where the run was not stable."""
    if not log.whole or not np.isfinite(log.force).all():
        return None
    force = np.array(log.force)
    fine = (
        np.array(reference.force)[: len(force) * round(step_ms / REFERENCE_MS)]
        .reshape(len(force), -1)
        .mean(axis=1)
    )
    share = float(np.sqrt(np.mean((force - fine) ** 2) / np.mean(fine**2)))
    if case.holds:
        first, last = (round(t / (step_ms * 1e-3)) for t in case.holds)
        if case.stroke == 0.0 and force[first:last].std() > 0.05:
            return None
    return share if share < 0.3 else None


def study(case: Case) -> dict[str, dict[str, float | None]]:
    """Return for every algorithm the largest stable step (ms), and error and energy made (J) at 5 ms."""
    reference = simulate(case, ALGORITHMS["impulse"], REFERENCE_MS)
    rows: dict[str, dict[str, float | None]] = {}
    for name, coupling in ALGORITHMS.items():
        row: dict[str, float | None] = {"largest_stable_step_ms": 0.0, "error": None, "energy_made_j": None}
        still_stable = True
        for step_ms in STEPS_MS:
            if not still_stable and step_ms > ERROR_STEP_MS:
                break
            log = simulate(case, coupling, step_ms)
            share = error(case, log, step_ms, reference)
            still_stable = still_stable and share is not None
            if still_stable:
                row["largest_stable_step_ms"] = step_ms
            if step_ms == ERROR_STEP_MS:
                row["error"], row["energy_made_j"] = share, log.energy_made_j if log.whole else None
        rows[name] = row
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", nargs="+", choices=list(CASES), default=list(CASES), metavar="CASE")
    parser.add_argument("--output", type=Path, help="write JSON")
    args = parser.parse_args()
    logging.disable(logging.CRITICAL)  # unstable runs are what is looked for
    table = {}
    for name in args.cases:
        table[name] = study(CASES[name])
        print(name)
        for algorithm, row in table[name].items():
            print(
                f"  {algorithm:28}",
                "  ".join(f"{key} {'-' if value is None else f'{value:.3g}'}" for key, value in row.items()),
                flush=True,
            )
    if args.output:
        args.output.write_text(json.dumps(table, indent=2) + "\n")


if __name__ == "__main__":
    main()
