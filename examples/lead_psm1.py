"""Move PSM1 along a square, as a program in plain Python: `trocar run psm` beside it.

`python lead_psm1.py tls/hub.lab:7447` leads a session on another machine (docs/how-to/programs.md).
"""

import sys

import numpy as np

import trocar
from trocar.programs import MotionError, Pose

SIDE = 0.02  # m


def main(endpoint=""):
    """Lead the arm round, grasp, and look."""
    with trocar.connect(endpoint=endpoint) as session:
        arm = session.PSM1
        if not arm.operating_state().is_homed:
            arm.home().wait()
        start = arm.setpoint_cp()
        for corner in ([SIDE, 0, 0], [SIDE, SIDE, 0], [0, SIDE, 0], [0, 0, 0]):
            goal = Pose(start.position + np.array(corner), start.orientation, start.frame)
            arm.move_cp(goal).wait()
            off = np.linalg.norm(arm.measured_cp().position - goal.position)
            print(f"{1e3 * off:.2f} mm from the corner {corner}, in frame {goal.frame}")
        arm.jaw.move_jp([0.0]).wait()
        print(f"jaw at {arm.jaw.measured_js().position[0]:.3f} rad")
        try:
            arm.move_jp([2.0, 0.0, 0.12, 0.0, 0.0, 0.0]).wait()
        except MotionError as refusal:
            print(refusal)
        picture = session.endoscope.left()
        print(f"picture of {picture.pixels.shape[1]} x {picture.pixels.shape[0]} pixels")


if __name__ == "__main__":
    main(*sys.argv[1:])
