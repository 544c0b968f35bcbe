"""What rolls a needle in a jaw: two pads on the fingers that one motor moves in opposite directions."""

from __future__ import annotations

import mujoco

from robots.dvrk.drives import Drive
from robots.dvrk.rolling_needle_driver import PADS, ROLLER, Roller

__all__ = ["add_drive"]

_TIE = {"solref": [1e-3, 1.0], "solimp": [0.999, 0.9999, 1e-4, 0.5, 2.0]}
"""As of the fingers of a jaw (`engines.mujoco.interaction.holding`): all but rigid."""


def add_drive(spec: mujoco.MjSpec, arm: str, roller: Roller, drive: Drive) -> None:
    """Tie the pads to each other and give them their motor, called `<arm>/roller`.

    It pulls a tendon whose length is the angle by which a wire of `roller.wire_radius` rolls (rad), so its
    force is a torque on that wire (N m). What the rotor weighs is shared by the pads: they are light, and
    MuJoCo's contacts give way in proportion to the inverse of the masses they touch.
    """
    share = 0.5 / roller.wire_radius  # rad of the wire by m of either pad
    tendon = spec.add_tendon(name=f"{arm}/{ROLLER}")
    for pad in PADS:
        joint = spec.joint(f"{arm}/{pad}")
        joint.armature = 2.0 * drive.armature * share**2
        tendon.wrap_joint(joint.name, share)
    left, right = (f"{arm}/{pad}" for pad in PADS)
    spec.add_equality(
        name=f"{arm}/pads",
        type=mujoco.mjtEq.mjEQ_JOINT,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        name1=left,
        name2=right,
        data=[0.0, 1.0, *[0.0] * 10],
        **_TIE,
    )
    actuator = spec.add_actuator(
        name=tendon.name,
        target=tendon.name,
        trntype=mujoco.mjtTrn.mjTRN_TENDON,
        ctrllimited=True,
        ctrlrange=[roller.joint.lower, roller.joint.upper],
        velrange=[-drive.velocity, drive.velocity],
        ffrange=[-drive.effort, drive.effort],
        forcelimited=True,
        forcerange=[-drive.effort, drive.effort],
    )
    inputs = mujoco.mjtCtrlInput
    actuator.set_to_pid(
        kp=drive.stiffness,
        kv=drive.damping,
        ctrlspec=int(inputs.mjINPUT_POS | inputs.mjINPUT_VEL | inputs.mjINPUT_FF),
    )
