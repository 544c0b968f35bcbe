"""Programs on real rclpy, one after another, that publish one command each as soon as they are matched.

Arguments: topic, `latched` or `once`, number of programs, length of the command.
"""

import sys
import time

import rclpy
from crtk_msgs.msg import StringStamped
from rclpy.qos import DurabilityPolicy, QoSProfile

DURABILITY = {"latched": DurabilityPolicy.TRANSIENT_LOCAL, "once": DurabilityPolicy.VOLATILE}


def publish_first(topic, kind, number, length):
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node(f"program{number}", context=context)
    publisher = node.create_publisher(StringStamped, topic, QoSProfile(depth=10, durability=DURABILITY[kind]))
    limit = time.monotonic() + 60.0
    while not publisher.get_subscription_count() and time.monotonic() < limit:
        time.sleep(0.0005)
    message = StringStamped(string="enable".ljust(length))
    message.header.frame_id = f"{kind}{number}"
    message.header.stamp = node.get_clock().now().to_msg()
    publisher.publish(message)
    time.sleep({"latched": 0.3, "once": 0.1}[kind])
    node.destroy_node()
    rclpy.shutdown(context=context)


for number in range(int(sys.argv[3])):
    publish_first(*sys.argv[1:3], number, int(sys.argv[4]))
