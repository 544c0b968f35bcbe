"""The patient-side manipulator (PSM) of the da Vinci Research Kit, Classic: numbers with their sources.

Sources: SAW = jhu-dvrk/sawIntuitiveResearchKit, release 2.3 tree of April 2026 (commit 9e535e68); FONT =
gafontanelli/DVRK-dynamicModel (commit 51c55d75), the code of Fontanelli et al., "Modelling and identification of the da
Vinci Research Kit robotic arms", IROS 2017, with its parameters PSM1_param.txt. The base frame has its origin in the
remote centre of motion (RCM), the instrument goes in along -z. SI units, radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians

from robots.dvrk.instruments import Instrument
from robots.dvrk.limits import jerk
from robots.serial_chain import Joint, SerialChain

__all__ = ["ARM_JOINTS", "CANNULA_DEPTH", "HOME", "INSERTION_MASS", "JOINT_NAMES", "SAFE_DISTANCE", "SERVO", "YAW_INERTIA_GROWTH", "Servo", "chain"]

_RCM_TO_CARRIAGE = 0.4318
"""Distance (m) of the instrument carriage from the RCM at insertion 0 (SAW share/kinematic/PSM.json, offset of joint 3)."""

_TURN, _SLIDE = radians(90.0), 0.2
"""Of the trajectories (SAW core/components/code/mtsIntuitiveResearchKitPSM.cpp, v_max and a_max): rad/s and rad/s^2; m/s and m/s^2."""

ARM_JOINTS = (
    Joint("yaw", "revolute", pi / 2, 0.0, 0.0, pi / 2, -1.588, 1.588, _TURN, 3.316101, _TURN, jerk(_TURN)),
    Joint("pitch", "revolute", -pi / 2, 0.0, 0.0, -pi / 2, -0.925025, 0.925025, _TURN, 3.316101, _TURN, jerk(_TURN)),
    Joint("insertion", "prismatic", pi / 2, 0.0, -_RCM_TO_CARRIAGE, 0.0, 0.0, 0.240, _SLIDE, 9.877926, _SLIDE, jerk(_SLIDE)),
)
"""The joints of the arm itself: modified DH, range and effort limit from SAW share/kinematic/PSM.json (1.5708 taken as pi/2)."""

JOINT_NAMES = ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")
"""As SAW names them in share/kinematic/PSM.json and share/tool/*.json."""

HOME = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
"""Where the real controller homes a simulated arm (SAW mtsIntuitiveResearchKitPSM.cpp): straight, insertion 0.12 m."""


CANNULA_DEPTH = 0.025
"""Insertion (m) at which an instrument is engaged in the cannula (SAW mtsIntuitiveResearchKit.h)."""

SAFE_DISTANCE = 0.045 + 0.002
"""From the RCM to the wrist pitch axis (m), beyond which the real controller lets the wrist and Cartesian motion go (same file: distance
and buffer)."""


@dataclass(frozen=True)
class Servo:
    """One joint's drive: controller gains, friction and inertia at the joint (rad, N m or m, N)."""

    stiffness: float
    """Proportional gain p of the joint controller, N m/rad or N/m (SAW share/pid/sawControllersPID-PSM.json)."""
    damping: float
    """Derivative gain d, on the error of the velocity, N m s/rad or N s/m (same file)."""
    viscous_friction: float
    """N m s/rad or N s/m (FONT, Fv)."""
    coulomb_friction: float
    """N m or N (FONT, Fs)."""
    inertia: float | None
    """Diagonal of the joint-space inertia at q = 0, kg m^2 or kg (FONT, evaluated); None where the model has none."""

    @property
    def critical_inertia(self) -> float:
        """The inertia (kg m^2) that the gains damp critically: d = 2 sqrt(p I)."""
        return self.damping**2 / (4.0 * self.stiffness)


SERVO = (
    Servo(120.0, 6.0, 0.136392294, 0.063000355, 0.207587156),
    Servo(120.0, 6.0, 0.137455713, 0.15057195, 0.197025532),
    Servo(6000.0, 200.0, 2.69, 0.596, 0.4167),
    Servo(6.0, 0.09, 0.0013, 0.0077, None),
    Servo(6.0, 0.09, 0.0104, 0.0198, None),
    Servo(6.0, 0.09, 0.0047, 0.0152, None),
)
"""The six joints in the order of `JOINT_NAMES`. The wrist has no inertia in FONT's model, and the other published
identification (WPI-AIM/dvrk_dynamics_identification) finds negative motor inertias there, that is, none that the data
can tell: `critical_inertia` stands in, the value for which the controller's gains would have been chosen."""

INSERTION_MASS = 0.2377
"""Mass (kg) that moves with the insertion; the counterweight makes up the rest of the joint's inertia (FONT, mass5)."""

YAW_INERTIA_GROWTH = (0.12, 0.211929687 - 0.207587156)
"""An insertion (m) and how much the yaw inertia (kg m^2) grows by it, at q = 0 else (FONT, evaluated)."""


def chain(instrument: Instrument) -> SerialChain:
    """Return the kinematics of the arm with `instrument`, from the RCM frame `<arm>_base` to the instrument's tip."""
    return SerialChain(ARM_JOINTS + instrument.joints, instrument.tip)
