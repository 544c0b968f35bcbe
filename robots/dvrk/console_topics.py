"""Topics of the dVRK's console, its system, its pedals and its teleoperation components.

Names of topics are those after their part's: `console/clutch` is `clutch`.

Source: jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68, ros/dvrk_robot/src/system_ROS.cpp); pedals and head
sensor as jhu-dvrk/dvrk-readthedocs (53699e4d) names them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from schemas.crtk import StringStamped
from schemas.ros import (
    BoolMessage,
    EmptyMessage,
    Float64Message,
    Float64MultiArray,
    Joy,
    QuaternionStamped,
    StringMessage,
)

__all__ = ["BUTTON", "CONSOLE", "PARTS", "PEDALS", "SETUP_JOINTS", "SYSTEM", "TELEOPERATION", "Topics"]

BUTTON = Joy.ros_type
"""buttons[0]: 0 released, 1 pressed, 2 a quick tap; no axes."""
_EMPTY, _STRING, _BOOL, _FLOAT = (
    EmptyMessage.ros_type,
    StringMessage.ros_type,
    BoolMessage.ros_type,
    Float64Message.ros_type,
)


@dataclass(frozen=True, slots=True)
class Topics:
    """Topics of one part, all of them events: name and ROS 2 type."""

    events: Mapping[str, str]
    """What the part publishes."""
    commands: Mapping[str, str] = field(default_factory=dict[str, str])
    """What it subscribes to."""


PEDALS = Topics(
    dict.fromkeys(("clutch", "camera", "cam_minus", "cam_plus", "bicoag", "coag", "operatorpresent"), BUTTON)
)

SYSTEM = Topics(
    events={"volume": _FLOAT},
    commands={
        "power_off": _EMPTY,
        "power_on": _EMPTY,
        "home": _EMPTY,
        "set_volume": _FLOAT,
        "beep": Float64MultiArray.ros_type,
        "string_to_speech": _STRING,
    },
)

CONSOLE = Topics(
    events={
        "teleop/enabled": _BOOL,
        "teleop/scale": _FLOAT,
        "teleop/selected": _STRING,
        "teleop/unselected": _STRING,
        "operator_present": BUTTON,
        "clutch": BUTTON,
        "camera": BUTTON,
        "warning": _STRING,
    },
    commands={
        "teleop/enable": _BOOL,
        "teleop/select": _STRING,
        "teleop/unselect": _STRING,
        "teleop/set_scale": _FLOAT,
        "emulate_operator_present": BUTTON,
        "emulate_clutch": BUTTON,
        "emulate_camera": BUTTON,
    },
)

SETUP_JOINTS = Topics({}, {"set_reference_arm": _STRING})

TELEOPERATION = Topics(
    events={
        "desired_state": _STRING,
        "current_state": _STRING,
        "following": _BOOL,
        "scale": _FLOAT,
        "align_mtm": _BOOL,
        "alignment_offset": QuaternionStamped.ros_type,
        "rotation_locked": _BOOL,
        "translation_locked": _BOOL,
        "warning": _STRING,
    },
    commands={
        "state_command": StringStamped.ros_type,
        "set_scale": _FLOAT,
        "lock_rotation": _BOOL,
        "lock_translation": _BOOL,
        "set_align_MTM": _BOOL,
    },
)
"""Topics of a component, such as `MTMR_PSM1`."""

PARTS = {"system": SYSTEM, "console": CONSOLE, "footpedals": PEDALS, "SUJ": SETUP_JOINTS}
"""What there is once, by the first part of its topics' names."""
