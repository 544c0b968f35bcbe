"""Bodies of PSM, ECM and instruments: masses, centres and inertia tensors.

PSM: the bodies of the arm are fitted so that the arm has the identified dynamics (`robots.dvrk.identified`)
with an instrument mounted; `bench/identified_inertia.py` makes the numbers in `data/psm_inertia.json`. ECM:
masses and centres from CAD, not identified; dvrk_env = WPI-AIM/dvrk_env (commit 675a3fa),
dvrk_description/ecm/ecm.urdf.xacro. MTM: fitted to its identification (`robots.dvrk.identified_mtm`);
`bench/identified_mtm_inertia.py` makes the numbers in `data/mtm_inertia.json`. See docs/decisions/0010.

SI units. All bodies of an arm stand in its base frame (origin in the remote centre of motion) with every
joint at 0, insertion included.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from types import MappingProxyType

import numpy as np

from robots.dvrk.ecm import chain as ecm_chain
from robots.dvrk.end_effectors.end_effector import Mount
from robots.dvrk.end_effectors.master_gripper import MasterGripper
from robots.dvrk.inertia import Inertia
from robots.dvrk.instruments import SHAFT_RADIUS, WRIST_RADIUS, Instrument
from robots.dvrk.mtm import chain as mtm_chain
from robots.dvrk.psm import chain as psm_chain

__all__ = ["ENDOSCOPE_MASS", "SHAFT_MASS", "ecm", "instrument", "mtm", "psm"]


SHAFT_MASS = 0.0117201
"""Mass of an instrument's shaft, kg, as modelled in unina-icaros/dvrk-vrep (body L1_respondable_TOOL1)."""
_YAW_LINK_MASS = 6.63661e-6
"""Mass of the wrist yaw link without fingers, kg (dvrk_env tool_lnd.urdf.xacro, CAD of the large needle
driver, for all).
"""
ENDOSCOPE_MASS: Mapping[str, float] = MappingProxyType(
    {"Classic_SD": 1.5, "Classic_HD": 2.5, "Si_HD": 1.8, "Custom": 0.8, "none": 0.1}
)
"""kg, with its camera head (jhu-dvrk/sawIntuitiveResearchKit, mtsIntuitiveResearchKitEndoscopeTypes.cdg)."""
_ENDOSCOPE_CENTRE = -0.1
"""Centre of an endoscope along the insertion axis in the frame of the insertion link, m (same project,
share/kinematic/ECM.json, cz).
"""
_ENDOSCOPE_LENGTH, _ENDOSCOPE_RADIUS = 0.603, 0.035
"""m, with camera head: bounds of ECM_tool.stl (jhu-dvrk/dvrk_model)."""


def psm(tool: Instrument) -> Mapping[str, Inertia]:
    """Return the bodies of a PSM with `tool` by link; the instrument's housing is part of the insertion."""
    return {**_fitted("psm"), **instrument(tool)}


def mtm() -> Mapping[str, Inertia]:
    """Return the bodies of a master by link, with its gripper; left and right are taken as alike."""
    return {**_fitted("mtm"), **MasterGripper().bodies(Mount.on(mtm_chain("MTML")))}


@cache
def _fitted(arm: str) -> Mapping[str, Inertia]:
    data = json.loads(files("robots.dvrk").joinpath(f"data/{arm}_inertia.json").read_text(encoding="utf-8"))
    return {
        name: Inertia(row["mass"], np.array(row["centre"]), np.array(row["tensor"]))
        for name, row in data["bodies"].items()
    }


def instrument(tool: Instrument) -> Mapping[str, Inertia]:
    """Return the moving bodies of an instrument by link: shaft, wrist, end effector."""
    chain = psm_chain(tool)
    origins = chain.frames(np.zeros(len(chain.joints)))[:-1, :3, 3]  # (n, 3)
    first = len(chain.joints) - len(tool.joints)
    bodies = {
        "roll": Inertia.of_rod(tool.roll_mass + SHAFT_MASS, origins[first - 1], origins[first], SHAFT_RADIUS)
    }
    for i in range(first + 1, len(chain.joints) - 1):
        bodies[chain.joints[i].name] = Inertia.of_rod(
            tool.pitch_mass, origins[i], origins[i + 1], WRIST_RADIUS
        )
    if tool.has_wrist:
        bodies[chain.joints[-1].name] = Inertia.of_ball(_YAW_LINK_MASS, origins[-1], WRIST_RADIUS)
    return {**bodies, **tool.end_effector.bodies(Mount.on(chain))}


_ECM_CAD = {
    "yaw": (6.4168, (0.0, -0.4327, -0.0290), (0.176, 0.267, 0.170)),
    "pitch": (2.0321, (-0.0008, -0.0849, 0.3141), (0.051, 0.129, 0.577)),
    "insertion": (0.23108, (-0.0008, -0.0524, 0.4209), (0.054, 0.033, 0.118)),
    "pitch_front": (1.6069, (0.0, -0.3710, 0.1358), (0.101, 0.253, 0.365)),
    "pitch_back": (0.4214, (0.0081, -0.4098, 0.1402), (0.030, 0.123, 0.307)),
    "pitch_bottom": (0.35928, (0.0, -0.2975, 0.3135), (0.050, 0.408, 0.074)),
    "pitch_top": (0.43851, (0.0, -0.2787, 0.3242), (0.012, 0.358, 0.018)),
}
"""Mass by link, centre (dvrk_env, CAD, carried from the link's frame to the base frame), and size of the mesh
(jhu-dvrk/dvrk_model, bounds): the tensors of the CAD are zero or no body's, so a uniform box of this size
stands in.
"""


def ecm(endoscope_mass: float = ENDOSCOPE_MASS["Classic_SD"]) -> Mapping[str, Inertia]:
    """Return the bodies of the ECM by link, with an endoscope of this mass (kg) on the roll."""
    bodies = {
        name: Inertia.of_box(mass, np.array(centre), np.array(size))
        for name, (mass, centre, size) in _ECM_CAD.items()
    }
    carriage = ecm_chain().frames(np.zeros(4))[2]  # (4, 4)
    middle = carriage[:3, 3] + _ENDOSCOPE_CENTRE * carriage[:3, 2]
    half = _ENDOSCOPE_LENGTH / 2.0 * carriage[:3, 2]
    bodies["roll"] = Inertia.of_rod(endoscope_mass, middle - half, middle + half, _ENDOSCOPE_RADIUS)
    return bodies
