"""What the motion controller keeps to beyond the ranges, velocities, accelerations and jerks of the joints,
which `robots.dvrk` states.

Sources: SAW = jhu-dvrk/sawIntuitiveResearchKit (commit 9e535e68). SI units, radians.
"""

from __future__ import annotations

from math import radians

__all__ = ["FOLLOWING_ACCELERATION", "GOAL_TOLERANCE", "HOMING_TIMEOUT", "STREAM_GAP", "TRACKING_TOLERANCE"]

FOLLOWING_ACCELERATION = 10.0
"""How many times the acceleration of a trajectory `servo_*` may take, and `hold` to brake. It makes 15.7
rad/s^2 of the PSM's yaw, about what its drive can do: 3.316 N m against 0.2076 kg m^2 are 16.0 rad/s^2 (see
docs/decisions/0011).
"""

STREAM_GAP = 0.1
"""s; `servo_*` commands further apart than this are no stream: ten periods of the dVRK's own 100 Hz."""

TRACKING_TOLERANCE = (0.5, 0.5, 0.05, 0.6, 0.6, 0.6)
"""Largest distance of a joint from its setpoint, rad and m, before the arm goes to FAULT (SAW
share/pid/sawControllersPID-PSM.json); the first four are taken for the ECM too.
"""

GOAL_TOLERANCE = radians(3.0)
"""Largest distance of a joint from home, rad and m, once homing is through (SAW
mtsIntuitiveResearchKit{PSM,ECM}.cpp).
"""

HOMING_TIMEOUT = 2.0
"""s after the end of the homing trajectory in which the arm must be there (SAW
mtsIntuitiveResearchKitArm.cpp, RunHoming).
"""
