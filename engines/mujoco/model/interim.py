from dataclasses import dataclass
from math import pi

import numpy as np

from engines.mujoco.model.tree import links
from engines.mujoco.params import PsmParams
from robots.dvrk import psm
from robots.dvrk.instruments import SHAFT_RADIUS, STEEL_DENSITY


@dataclass
class Drive:
    stiffness: float
    damping: float
    viscous_friction: float
    coulomb_friction: float
    effort: float
    velocity: float
    armature: float


@dataclass
class Inertia:
    mass: float
    centre: np.ndarray
    tensor: np.ndarray


def drive(params, name):
    if name.startswith("jaw"):
        return Drive(0.5, 0.01, 0.0002, 0.0, 0.16, 4 * pi, 2e-5)
    joint = next(j for j in params.chain.joints if j.name == name)
    if not isinstance(params, PsmParams):
        return Drive(1000.0 if name != "insertion" else 6000.0, 100.0 if name != "insertion" else 200.0, 0.1, 0.1, joint.effort, joint.velocity, 0.1)
    i = psm.JOINT_NAMES.index(name)
    s = psm.SERVO[i]
    arm = s.critical_inertia if s.inertia is None else s.inertia - (0.013, 0.013, 0.2377)[i]
    return Drive(s.stiffness, s.damping, s.viscous_friction, s.coulomb_friction, joint.effort, joint.velocity, arm)


def inertias(params):
    out = {}
    for link in links("PSM1" if isinstance(params, PsmParams) else "ECM", params):
        out[link.name] = Inertia(1e-6, link.pose[:3, 3], 1e-6 * np.eye(3))
    dq, growth = psm.YAW_INERTIA_GROWTH
    if isinstance(params, PsmParams):
        depth = (growth / psm.INSERTION_MASS - dq**2) / (2.0 * dq)
        out["insertion"] = Inertia(psm.INSERTION_MASS, np.array([0, 0, -depth]), 1e-6 * np.eye(3))
        tool = params.tool
        out["roll"] = Inertia(tool.roll_mass, out["roll"].centre, 0.4 * tool.roll_mass * SHAFT_RADIUS**2 * np.eye(3))
        out["wrist_pitch"] = Inertia(tool.pitch_mass, out["wrist_pitch"].centre, tool.pitch_mass * 0.0091**2 / 12 * np.eye(3))
        m = STEEL_DENSITY * 4.0 / 3.0 * pi * params.probe_radius**3
        out["wrist_yaw"] = Inertia(m, out["wrist_yaw"].centre, 0.4 * m * params.probe_radius**2 * np.eye(3))
        for f in ("jaw_left", "jaw_right"):
            if f in out:
                out[f] = Inertia(3.9e-5, out[f].centre, 3.9e-5 * 1e-5 * np.eye(3))
    return out
