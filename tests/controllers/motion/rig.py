"""A motion controller stepped by hand, with a robot that is always exactly where it is told to be, or where a
test puts it.
"""

import numpy as np

from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from hub.testing import Driver
from schemas.crtk import CartesianImpedance, CartesianImpedanceHalfPlaneGains, CartesianState, StringStamped
from schemas.ros import (
    BoolMessage,
    EmptyMessage,
    Float64Message,
    Header,
    JointState,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Twist,
    Vector3,
    Wrench,
    WrenchStamped,
)

H = 1_000_000
HOME = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
PSM1 = {"PSM1": {"instrument": "400006"}}
CART = {**PSM1, "PSM2": {"instrument": "400006"}, "PSM3": {"instrument": "400006"}, "ECM": {}}


class Rig:
    def __init__(self, arms=PSM1, initial_state="homed", **params):
        self.motion = MotionController(
            "motion",
            MotionParams.model_validate(
                {"mounting": "cart", "arms": arms, "initial_state": initial_state, **params}
            ),
        )
        self.driver = Driver(self.motion, period_ns=H)
        self.sensed = self.driver.values
        self.follows = True
        self.heard = {}
        self.mirror()

    outputs = property(lambda self: self.driver.outputs)

    def mirror(self):
        for port, value in self.sensed.items():
            command = self.outputs[port.replace("sense/", "drive/").replace("measured_js", "servo_jp")]
            value[: command.size] = command

    def step(self, count=1, **orders):
        """Step; orders of the first step by port, `__` for `/`; PSM1's unless they name an arm."""
        for name, order in orders.items():
            port = name.replace("__", "/")
            port = port if port.startswith(("PSM", "ECM", "SUJ")) else f"PSM1/{port}"
            self.driver.send(port, *(order if isinstance(order, tuple) else (order,)))
        self.heard = {}
        for _ in range(count):
            self.driver.step()
            if self.follows:
                self.mirror()
            for port, messages in self.driver.sent.items():
                self.heard[port] = (*self.heard.get(port, ()), *messages)
        return self

    def command(self, text, count=1):
        return self.step(count, state_command=StringStamped(string=text))

    def said(self, name, arm="PSM1"):
        """What was said on an event port since the orders were given."""
        return [getattr(message, "data", message) for message in self.heard.get(f"{arm}/{name}", ())]

    def states(self, arm="PSM1"):
        return [(m.state, m.is_homed, m.is_busy) for m in self.said("operating_state", arm)]

    @property
    def setpoint(self):
        return self.outputs["drive/PSM1/servo_jp"].copy()

    @property
    def mode(self):
        return self.outputs["drive/PSM1/control_mode"].tolist()

    def until_idle(self, most=20_000):
        for _ in range(most):
            self.step()
            if any(not busy for _, _, busy in self.states()):
                return self
        raise AssertionError("still busy")


def jp(*values, names=()):
    return JointState(name=list(names), position=np.array(values, np.float64))


def jf(*values):
    return JointState(effort=np.array(values, np.float64))


def cp(pose, frame=""):
    x, y, z, *q = (float(value) for value in pose)
    orientation = Quaternion.model_construct(**dict(zip("xyzw", q, strict=True)))
    return PoseStamped.model_construct(
        header=Header(frame_id=frame),
        pose=Pose.model_construct(position=Point.model_construct(x=x, y=y, z=z), orientation=orientation),
    )


def two_vectors(values):
    return (
        Vector3.model_construct(**dict(zip("xyz", map(float, part), strict=True)))
        for part in (values[:3], values[3:])
    )


def cf(*values, frame=""):
    force, torque = two_vectors(values)
    return WrenchStamped.model_construct(
        header=Header(frame_id=frame), wrench=Wrench.model_construct(force=force, torque=torque)
    )


def cs(pose=None, twist=None, wrench=None, frame=""):
    """A Cartesian state that states what is given."""
    parts = {"header": Header(frame_id=frame)}
    if pose is not None:
        parts |= {"pose": cp(pose).pose, "pose_is_valid": BoolMessage(data=True)}
    if twist is not None:
        linear, angular = two_vectors(twist)
        parts |= {
            "twist": Twist.model_construct(linear=linear, angular=angular),
            "twist_is_valid": BoolMessage(data=True),
        }
    if wrench is not None:
        parts |= {"wrench": cf(*wrench).wrench, "wrench_is_valid": BoolMessage(data=True)}
    return CartesianState.model_construct(**(CartesianState().__dict__ | parts))


def ci(pose, frame="", **gains):
    """A Cartesian impedance about `pose`: gains by side and name, such as `position_positive={"p": (0, 0,
    -200)}`.
    """
    goal = cp(pose).pose
    sides = {
        side: CartesianImpedanceHalfPlaneGains(
            **{name: Vector3(**dict(zip("xyz", map(float, v), strict=True))) for name, v in row.items()}
        )
        for side, row in gains.items()
    }
    at = Vector3.model_construct(x=goal.position.x, y=goal.position.y, z=goal.position.z)
    parts = {
        "header": Header(frame_id=frame),
        "force_position": at,
        "force_orientation": goal.orientation,
        "torque_orientation": goal.orientation,
    }
    return CartesianImpedance.model_construct(**(CartesianImpedance().__dict__ | parts | sides))


EMPTY = EmptyMessage()


def ratio(value):
    return Float64Message(data=value)
