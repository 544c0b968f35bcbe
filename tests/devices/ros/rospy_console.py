"""A ROS 1 program on real rospy that shares nothing with the gateway; run by the Python that has rospy, not
by ours.

As a program it takes orders from standard input, one JSON list a line, and answers each with a line:
`["answer", ...]` or `["error", "why"]`. As a module it has `Arm`, a client of CRTK as crtk_python_client is
one (written from its behaviour), for whoever measures with it.
"""

import json
import queue
import re
import sys
import time
from threading import Condition
from types import SimpleNamespace

import genmsg
import genpy.dynamic
import roslib.message
import rospy

RULER = "\n" + "=" * 80 + "\n"
TEXTS = {
    "crtk_msgs/OperatingState": "Header header\nstring state\nbool is_homed\nbool is_busy",
    "crtk_msgs/StringStamped": "std_msgs/Header header\nstring string",
    "crtk_msgs/CartesianState": (
        "std_msgs/Header header\ngeometry_msgs/Pose pose\nstd_msgs/Bool pose_is_valid\ngeometry_msgs/Twist"
        " twist\nstd_msgs/Bool twist_is_valid\ngeometry_msgs/Wrench wrench\nstd_msgs/Bool wrench_is_valid"
    ),
    "crtk_msgs/CartesianImpedanceHalfPlaneGains": "\n".join(
        f"geometry_msgs/Vector3 {name}" for name in ("p", "d", "bias", "deadband")
    ),
    "crtk_msgs/CartesianImpedance": (
        "Header header\ngeometry_msgs/Quaternion force_orientation\ngeometry_msgs/Vector3"
        " force_position\ngeometry_msgs/Quaternion"
        " torque_orientation\ncrtk_msgs/CartesianImpedanceHalfPlaneGains"
        " position_positive\ncrtk_msgs/CartesianImpedanceHalfPlaneGains"
        " position_negative\ncrtk_msgs/CartesianImpedanceHalfPlaneGains"
        " orientation_positive\ncrtk_msgs/CartesianImpedanceHalfPlaneGains orientation_negative"
    ),
    "diagnostic_msgs/KeyValue": "string key\nstring value",
    "diagnostic_msgs/DiagnosticStatus": (
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\nstring"
        " hardware_id\nKeyValue[] values"
    ),
    "diagnostic_msgs/DiagnosticArray": "Header header\nDiagnosticStatus[] status",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    # docs.ros.org/en/noetic/api/visualization_msgs: constants are part of the checksum
    "visualization_msgs/Marker": (
        "uint8 ARROW=0\nuint8 CUBE=1\nuint8 SPHERE=2\nuint8 CYLINDER=3\nuint8 LINE_STRIP=4\n"
        "uint8 LINE_LIST=5\nuint8 CUBE_LIST=6\nuint8 SPHERE_LIST=7\nuint8 POINTS=8\n"
        "uint8 TEXT_VIEW_FACING=9\nuint8 MESH_RESOURCE=10\nuint8 TRIANGLE_LIST=11\nuint8 ADD=0\n"
        "uint8 MODIFY=0\nuint8 DELETE=2\nuint8 DELETEALL=3\n"
        "Header header\nstring ns\nint32 id\nint32 type\nint32 action\n"
        "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nduration lifetime\n"
        "bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring text\n"
        "string mesh_resource\nbool mesh_use_embedded_materials"
    ),
    "visualization_msgs/MarkerArray": "Marker[] markers",
    "crtk_msgs/QueryForwardKinematics": (
        "float64[] jp\ngeometry_msgs/Pose cp\n---\ngeometry_msgs/Pose cp\nbool result\nstring message"
    ),
    "crtk_msgs/QueryInverseKinematics": (
        "geometry_msgs/Pose cp\nfloat64[] jp\n---\nfloat64[] jp\nbool result\nstring message"
    ),
}
made = {}


def ros1(type_):
    """`sensor_msgs/msg/JointState` to `sensor_msgs/JointState`."""
    return re.sub("/(msg|srv)/", "/", type_)


def text_of(name):
    return (
        TEXTS[name]
        if name in TEXTS
        else roslib.message.get_message_class(name)._full_text.split(RULER[:-1])[0]
    )


def held(name, text):
    """Return the messages that a definition holds, and those that these hold; what has no package is of the
    same.
    """
    found = {}
    for kind in re.findall(r"^([A-Za-z_]\w*(?:/\w+)?)(?:\[\d*\])?\s+\w+", text, re.MULTILINE):
        if kind == "Header" or kind[0].isupper() or "/" in kind:
            part = (
                "std_msgs/Header"
                if kind == "Header"
                else kind
                if "/" in kind
                else f"{name.partition('/')[0]}/{kind}"
            )
            found |= {part: text_of(part)} | held(part, text_of(part))
    return found


def built(name, text):
    whole = text + "".join(f"{RULER}MSG: {part}\n{inner}" for part, inner in held(name, text).items())
    return genpy.dynamic.generate_dynamic(name, whole)[name]


def message_class(type_):
    name = ros1(type_)
    if name not in made:
        made[name] = built(name, TEXTS[name]) if name in TEXTS else roslib.message.get_message_class(name)
    return made[name]


def service_class(type_):
    name = ros1(type_)
    context = genmsg.MsgContext.create_default()
    for part, text in held(name, TEXTS[name]).items():
        genmsg.msg_loader.load_msg_from_string(context, text, part)
    spec = genmsg.msg_loader.load_srv_from_string(context, TEXTS[name], name)
    request, response = (
        built(f"{name}{part}", text)
        for part, text in zip(("Request", "Response"), TEXTS[name].split("\n---\n"), strict=True)
    )
    return SimpleNamespace(
        _type=name,
        _md5sum=genmsg.compute_md5(context, spec),
        _request_class=request,
        _response_class=response,
    )


def flat(value):
    """Return a message as JSON has it, with the names of ROS 2."""
    if isinstance(value, genpy.TVal):
        return {"sec": value.secs, "nanosec": value.nsecs}
    if isinstance(value, genpy.Message):
        fields = {
            name.lower() if len(name) == 1 else name: flat(getattr(value, name))
            for name in value.__slots__
            if name != "seq"
        }
        return fields or {"structure_needs_at_least_one_member": 0}
    return [flat(each) for each in value] if isinstance(value, bytes | list | tuple) else value


def filled(message, fields):
    """Fill a message from what `flat` returns."""
    for name, kind in zip(message.__slots__, message._slot_types, strict=True):
        if name == "seq":
            continue
        given, now = fields[name.lower() if len(name) == 1 else name], getattr(message, name)
        if isinstance(now, genpy.TVal):
            now.secs, now.nsecs = given["sec"], given["nanosec"]
        elif isinstance(now, genpy.Message):
            filled(now, given)
        elif isinstance(given, list) and given and isinstance(given[0], dict):
            setattr(message, name, [filled(message_class(kind[:-2])(), each) for each in given])
        else:
            setattr(message, name, bytes(given) if isinstance(now, bytes) else given)
    return message


def raw(kind, octets):
    """Return what rospy takes for a message of a kind and sends as these bytes."""
    return type("Raw", (kind,), {"serialize": lambda self, buffer: buffer.write(bytes(octets))})()


def connected(ends, seconds=60.0):
    """Wait until each publisher and subscriber has a peer; return the topics of those without.

    rospy counts a subscriber's connection before it is made (`create_transport`), so `get_num_connections` is
    no answer. The limit counts naps: a machine that stood still has not waited.
    """
    for _ in range(round(seconds / 0.01)):
        if not alone(ends):
            break
        time.sleep(0.01)
    return alone(ends)


def alone(ends):
    return [end.name for end in ends if not any(each.remote_endpoint[1] for each in end.impl.connections)]


class Arm:
    """Enables, homes and moves one arm, and waits as crtk_python_client does: for busy told after the order,
    then for not busy.
    """

    def __init__(self, name, stamped=True):
        self.name, self.stamped = name, stamped
        self.changed, self.state, self.joints, self.events, self.states = Condition(), None, None, [], 0
        self.kept = [
            rospy.Subscriber(
                f"/{name}/operating_state",
                message_class("crtk_msgs/OperatingState"),
                self._told,
                queue_size=100,
            )
        ]
        self.kept.append(
            rospy.Subscriber(
                f"/{name}/measured_js",
                message_class("sensor_msgs/JointState"),
                self._measured,
                queue_size=10,
                tcp_nodelay=True,
            )
        )
        self.state_command = rospy.Publisher(
            f"/{name}/state_command", message_class("crtk_msgs/StringStamped"), latch=True, queue_size=10
        )
        joints = message_class("sensor_msgs/JointState")
        self.movers = {
            kind: rospy.Publisher(f"/{name}/{kind}", joints, queue_size=10, tcp_nodelay=True)
            for kind in ("move_jp", "servo_jp")
        }

    def _told(self, message):
        with self.changed:
            # older ones are not looked at
            if self.state is None or message.header.stamp > self.state.header.stamp:
                self.state = message
                self.events.append(message)
                self.changed.notify_all()

    def _measured(self, message):
        self.joints = message
        self.states += 1

    def connected(self, seconds=60.0):
        """Wait for a peer of everything; say whether all have one."""
        return not connected([*self.kept, self.state_command, *self.movers.values()], seconds)

    def _until(self, holds, seconds):
        with self.changed:
            if not self.changed.wait_for(holds, seconds):
                raise TimeoutError(
                    f"{self.name}: still waiting after {seconds} s; last told: {self.events[-3:]}"
                )

    def command(self, word):
        message = message_class("crtk_msgs/StringStamped")()
        message.string = word
        if self.stamped:
            message.header.stamp = rospy.Time.now()
        self.state_command.publish(message)

    def _commanded(self, word, holds, seconds):
        with self.changed:
            heard = len(self.events)
        self.command(word)
        self._until(lambda: any(holds(state) for state in self.events[heard:]), seconds)

    def enable(self, seconds=60.0):
        self._commanded("enable", lambda state: state.state == "ENABLED" and not state.is_busy, seconds)

    def disable(self, seconds=60.0):
        self._commanded("disable", lambda state: state.state == "DISABLED" and not state.is_busy, seconds)

    def home(self, seconds=60.0):
        self._commanded("home", lambda state: state.is_homed and not state.is_busy, seconds)

    def servo_jp(self, positions):
        self._order("servo_jp", positions)

    def _order(self, kind, positions):
        message = message_class("sensor_msgs/JointState")()
        message.position = list(positions)
        message.header.stamp = rospy.Time.now()
        self.movers[kind].publish(message)

    def move_jp(self, positions, seconds=60.0):
        """Move, and wait until it is done: `move_jp(...).wait()`."""
        with self.changed:
            heard = len(self.events)
        self._order("move_jp", positions)
        self._until(
            lambda: any(state.is_busy for state in self.events[heard:]) and not self.events[-1].is_busy,
            seconds,
        )


class Console:
    """Carries out orders."""

    def __init__(self):
        self.heard_of, self.publishers, self.services, self.arms, self.count = {}, {}, {}, {}, {}

    def subscribe(self, topic, type_):
        heard = self.heard_of[topic] = queue.Queue()
        return rospy.Subscriber(topic, message_class(type_), heard.put)

    def advertise(self, topic, type_, latch=False):
        self.publishers[topic] = rospy.Publisher(topic, message_class(type_), queue_size=100, latch=latch)

    def join(self, rows):
        """Make a peer of every row, and wait until all are connected."""
        heard = [self.subscribe(topic, type_) for topic, type_, way in rows if way == "publish"]
        for topic, type_, way in rows:
            if way == "subscribe":
                self.advertise(topic, type_)
            elif way == "serve":
                self.services[topic] = rospy.ServiceProxy(topic, service_class(type_), persistent=True)
        for topic in self.services:
            rospy.wait_for_service(topic, 60.0)
        return connected(heard + [self.publishers[topic] for topic, _, way in rows if way == "subscribe"])

    def listen(self, topic, type_):
        self.subscribe(topic, type_)

    def send(self, topic, fields, times=1):
        publisher = self.publishers[topic]
        message = filled(publisher.data_class(), fields)
        for _ in range(times):
            publisher.publish(message)

    def raw(self, topic, octets):
        """Publish bytes as they are."""
        publisher = self.publishers[topic]
        publisher.publish(raw(publisher.data_class, octets))

    def heard(self, topic, seconds):
        try:
            return flat(self.heard_of[topic].get(timeout=seconds))
        except queue.Empty:
            return None

    def sequence(self, topic):
        """Return the counters in the headers of what was heard."""
        heard = self.heard_of[topic]
        return [heard.get().header.seq for _ in range(heard.qsize())]

    def checksums(self, types):
        return [(service_class if "/srv/" in type_ else message_class)(type_)._md5sum for type_ in types]

    def call(self, topic, fields):
        service = self.services[topic]
        return flat(service(filled(service.request_class(), fields)))

    def refused_call(self, topic, octets):
        """Return what is said to a request of these bytes."""
        service = self.services[topic]
        try:
            service(raw(service.request_class, octets))
        except rospy.ServiceException as error:
            return str(error)
        return ""

    def wait_for_peers(self, topic):
        return not connected([self.publishers[topic]])

    def arm(self, name, method, *arguments):
        if name not in self.arms:
            self.arms[name] = Arm(name)
        arm = self.arms[name]
        if method == "positions":
            return list(arm.joints.position)
        if method == "edges":
            return [[state.state, state.is_homed, state.is_busy] for state in arm.events]
        return getattr(arm, method)(*arguments)


def main(name):
    rospy.init_node(name, anonymous=False, disable_signals=True, disable_rosout=True)
    console = Console()
    for line in sys.stdin:
        order, *arguments = json.loads(line)
        try:
            answer = ["answer", getattr(console, order)(*arguments)]
        except Exception as error:  # noqa: BLE001  # the test gets it
            answer = ["error", f"{type(error).__name__}: {error}"]
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
    rospy.signal_shutdown("done")


if __name__ == "__main__":
    main(sys.argv[1])
