"""What the dVRK's console, its system and its teleoperation components say and hear: names of topics without
those of their parts, and ROS 2 types.

Source: jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68, ros/dvrk_robot/src/system_ROS.cpp); pedals as
jhu-dvrk/dvrk-readthedocs (53699e4d) names them, and the head sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

__all__ = ["BUTTON", "CONSOLE", "PEDALS", "SYSTEM", "TELEOPERATION", "Topics"]

_EMPTY, _STRING, _BOOL, _FLOAT = (f"std_msgs/msg/{name}" for name in ("Empty", "String", "Bool", "Float64"))
BUTTON = "sensor_msgs/msg/Joy"
"""buttons[0]: 0 released, 1 pressed, 2 a quick tap; no axes."""


@dataclass(frozen=True, slots=True)
class Topics:
    """Topics of one part: events, all of them."""

    told: Mapping[str, str]
    heard: Mapping[str, str] = field(default_factory=dict[str, str])


PEDALS = Topics(
    dict.fromkeys(("clutch", "camera", "cam_minus", "cam_plus", "bicoag", "coag", "operatorpresent"), BUTTON)
)

SYSTEM = Topics(
    told={"volume": _FLOAT},
    heard={
        "power_off": _EMPTY,
        "power_on": _EMPTY,
        "home": _EMPTY,
        "set_volume": _FLOAT,
        "beep": "std_msgs/msg/Float64MultiArray",
        "string_to_speech": _STRING,
    },
)

CONSOLE = Topics(
    told={
        "teleop/enabled": _BOOL,
        "teleop/scale": _FLOAT,
        "teleop/selected": _STRING,
        "teleop/unselected": _STRING,
        "operator_present": BUTTON,
        "clutch": BUTTON,
        "camera": BUTTON,
        "warning": _STRING,
    },
    heard={
        "teleop/enable": _BOOL,
        "teleop/select": _STRING,
        "teleop/unselect": _STRING,
        "teleop/set_scale": _FLOAT,
        "emulate_operator_present": BUTTON,
        "emulate_clutch": BUTTON,
        "emulate_camera": BUTTON,
    },
)

TELEOPERATION = Topics(
    told={
        "desired_state": _STRING,
        "current_state": _STRING,
        "following": _BOOL,
        "scale": _FLOAT,
        "align_mtm": _BOOL,
        "alignment_offset": "geometry_msgs/msg/QuaternionStamped",
        "rotation_locked": _BOOL,
        "translation_locked": _BOOL,
        "warning": _STRING,
    },
    heard={
        "state_command": "crtk_msgs/msg/StringStamped",
        "set_scale": _FLOAT,
        "lock_rotation": _BOOL,
        "lock_translation": _BOOL,
        "set_align_MTM": _BOOL,
    },
)
