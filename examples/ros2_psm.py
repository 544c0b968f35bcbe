"""Home PSM1 and move it there and back, as on a dVRK, from a machine with ROS 2 and crtk_msgs.

Where the simulation is, `trocar run ros`; where ROS is, `RMW_IMPLEMENTATION=rmw_zenoh_cpp python3
ros2_psm.py` (docs/ros.md).
"""

import time

import rclpy
from crtk_msgs.msg import OperatingState, StringStamped
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
HOME, AWAY = [0.0, 0.0, 0.12, 0.0, 0.0, 0.0], [-0.2, 0.1, 0.12, 0.0, 0.0, 0.5]


class Arm:
    """What a program needs of an arm to move it and to know when it is there."""

    def __init__(self, node, name):
        self.node, self.states, self.position = node, [], None
        node.create_subscription(OperatingState, f"/{name}/operating_state", self.states.append, LATCHED)
        node.create_subscription(JointState, f"/{name}/measured_js", self._measured, 10)
        self.state_command = node.create_publisher(StringStamped, f"/{name}/state_command", 10)
        self.move_jp = node.create_publisher(JointState, f"/{name}/move_jp", 10)
        self.until(lambda: self.states and self.position is not None, f"the states of /{name}")
        self.until(
            lambda: self.state_command.get_subscription_count() and self.move_jp.get_subscription_count(),
            f"a subscriber of the commands to /{name}",
        )

    def _measured(self, message):
        self.position = message.position

    def until(self, holds, what, seconds=20.0):
        """Let messages come until something holds."""
        end = time.monotonic() + seconds
        while not holds():
            if time.monotonic() > end:
                raise TimeoutError(f"waited {seconds:g} s for {what}")
            rclpy.spin_once(self.node, timeout_sec=0.1)

    def done(self, publisher, message, what):
        """Send a command, and wait until the arm was busy and is not any more."""
        message.header.stamp = self.node.get_clock().now().to_msg()
        self.states.clear()
        publisher.publish(message)
        self.until(lambda: any(state.is_busy for state in self.states) and not self.states[-1].is_busy, what)


def main():
    """Home, there, back."""
    rclpy.init()
    arm = Arm(rclpy.create_node("first_steps"), "PSM1")
    if not arm.states[-1].is_homed:
        arm.done(arm.state_command, StringStamped(string="home"), "homing")
    for goal in (AWAY, HOME):
        arm.done(arm.move_jp, JointState(position=goal), "the move")
        print("at", [round(value, 3) for value in arm.position])


if __name__ == "__main__":
    main()
