"""Programs in plain Python that lead the arms of a running session: what `trocar.connect` returns.

    import trocar

    with trocar.connect() as s:                  # beside `trocar run psm`
        s.PSM1.move_jp([0.1, 0, 0.12, 0, 0, 0]).wait()
        print(s.PSM1.measured_cp().position)     # m
        picture = s.endoscope.left().pixels      # (height, width, 3), RGB

`Client` has the arms (`Arm`, with `JointGroup` for the jaw and `Tip` for further frames) and cameras
(`Camera`) of the session. `Handle` is a command under way; `Joints`, `Pose`, `Twist`, `Wrench` and `Picture`
are values. `MotionError` is a refusal by the arm, `SessionError` the end of the session, `ConnectError` a
session or a value that is not there. `IsaacTeleopPsm` lets an arm follow NVIDIA's IsaacTeleop.
docs/how-to/programs.md.
"""

from devices.programs.arm import Arm, JointGroup, Tip
from devices.programs.camera import Camera
from devices.programs.client import Client
from devices.programs.handles import Handle
from devices.programs.isaac_teleop import IsaacTeleopPsm
from devices.programs.sessions import connect
from devices.programs.values import Joints, Picture, Pose, Twist, Wrench
from schemas.errors import ConnectError, MotionError, SessionError

__all__ = [
    "Arm",
    "Camera",
    "Client",
    "ConnectError",
    "Handle",
    "IsaacTeleopPsm",
    "JointGroup",
    "Joints",
    "MotionError",
    "Picture",
    "Pose",
    "SessionError",
    "Tip",
    "Twist",
    "Wrench",
    "connect",
]
