"""Show a stitch in the endoscope's pictures: points, path, disc, arrow and words, which change as it goes on.

Where the simulation is, `trocar run ros` (or `trocar run ros-vrep`, whose camera is called `/stereo`);
where ROS is, `python3 augmented_reality.py [--camera /stereo]`, with RMW_IMPLEMENTATION and domain as in
docs/ros.md.
"""

import argparse
import math
import time

import rclpy
from geometry_msgs.msg import Point, Vector3
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import ColorRGBA, String
from visualization_msgs.msg import Marker, MarkerArray

BLUE, RED, GREEN, YELLOW, PANE = (
    ColorRGBA(r=r, g=g, b=b, a=a)
    for r, g, b, a in (
        (0.0, 0.0, 1.0, 1.0),
        (1.0, 0.0, 0.0, 1.0),
        (0.1, 0.9, 0.2, 1.0),
        (1.0, 0.9, 0.2, 1.0),
        (0.2, 0.8, 1.0, 0.4),
    )
)
RADIUS, BITE, ABOVE = 11.44e-3, 16e-3, 4e-3
"""Of the needle; from entry to exit; of the points over the table. m."""


def marker(name, kind, color, size, frame="needle", **fields):
    """Return a marker that moves with its frame; `size` in m."""
    made = Marker(ns=name, type=kind, color=color, frame_locked=True, **fields)
    made.header.frame_id = frame
    made.scale = Vector3(x=size[0], y=size[1], z=size[2])
    return made


def points(name, color, places):
    """Return spheres of 2 mm, however many."""
    return marker(name, Marker.SPHERE_LIST, color, (2e-3, 2e-3, 2e-3), points=places)


def stitches(count, side):
    """Return as many entries (side 1) or exits (-1) beside the needle, 5 mm apart."""
    return [Point(x=side * BITE / 2, y=0.02 + 5e-3 * i, z=ABOVE) for i in range(count)]


def path(angle):
    """Return the needle's way through the tissue up to an angle, as a strip of lines."""
    way = [
        Point(x=RADIUS * math.cos(a), y=0.02, z=ABOVE + 8.2e-3 - RADIUS * math.sin(a))
        for a in (math.pi * 0.25 + angle * i / 16 for i in range(17))
    ]
    return marker("path", Marker.LINE_STRIP, YELLOW, (0.6e-3, 0.0, 0.0), points=way)


def words(text, color, camera):
    """Return a text of 4 mm letters, 100 mm before the left eye and turned to it."""
    made = marker(
        "words", Marker.TEXT_VIEW_FACING, color, (0.0, 0.0, 4e-3), frame=f"{camera}_left_optical", text=text
    )
    made.pose.position = Point(x=0.0, y=-0.032, z=0.1)
    return made


def disc():
    """Return the plane of the needle's path: a transparent disc, upright."""
    made = marker("disc", Marker.CYLINDER, PANE, (2 * RADIUS, 2 * RADIUS, 0.2e-3))
    made.pose.position = Point(x=0.0, y=0.02, z=ABOVE + 8.2e-3)
    made.pose.orientation.x = made.pose.orientation.w = math.sqrt(0.5)
    return made


def arrow():
    """Return an arrow down to the first entry, which goes after two seconds by itself."""
    ends = [Point(x=BITE / 2, y=0.02, z=ABOVE + z) for z in (0.02, 2e-3)]
    made = marker("arrow", Marker.ARROW, GREEN, (1.5e-3, 3e-3, 0.0), points=ends)
    made.lifetime.sec = 2
    return made


def stages(camera):
    """Yield what is to be seen, one after the other: colour, number, place and text change."""
    yield [words("Pick the entry", YELLOW, camera), points("entry", BLUE, stitches(1, 1)), arrow()]
    yield [
        words("Pick the exit", YELLOW, camera),
        points("entry", BLUE, stitches(4, 1)),
        points("exit", RED, stitches(4, -1)),
    ]
    for step in range(1, 6):
        share = f"Drive the needle {20 * step} %"
        yield [words(share, GREEN if step < 3 else YELLOW, camera), disc(), path(math.pi / 2 * step / 5)]
    done = [points("entry", GREEN, stitches(1, 1)), points("exit", GREEN, stitches(1, -1))]
    gone = Marker(ns="disc", action=Marker.DELETE)
    yield [gone, words("Done", GREEN, camera), *done]


def main():
    """Show the stages, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--camera", default="/endoscope", help="what the topics of the camera begin with")
    parser.add_argument("--frame", default="endoscope", help="the camera's name in the scenario")
    parser.add_argument("--seconds", type=float, default=1.5, help="from one stage to the next")
    options = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node("augmented_reality")
    publisher = node.create_publisher(MarkerArray, f"{options.camera}/markers", 10)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(String, f"{options.camera}/error", lambda told: print(told.data), latched)
    end = time.monotonic() + 20.0
    while not publisher.get_subscription_count():
        if time.monotonic() > end:
            raise TimeoutError(f"waited 20 s for a subscriber of {options.camera}/markers")
        rclpy.spin_once(node, timeout_sec=0.1)
    for markers in stages(options.frame):
        publisher.publish(MarkerArray(markers=markers))
        print("shown:", next(made.text for made in markers if made.ns == "words"))
        due = time.monotonic() + options.seconds
        while (left := due - time.monotonic()) > 0.0:
            rclpy.spin_once(node, timeout_sec=left)


if __name__ == "__main__":
    main()
