import pytest
from pydantic import ValidationError

from hub.planning.plan import Plan
from schemas.errors import ScenarioError
from schemas.ports import BondSide
from tests.hub.parts import Part, Stylus, into, out, plan_of

POSE, TEXT, JOINTS = "geometry_msgs/msg/PoseStamped", "std_msgs/msg/String", "sensor_msgs/msg/JointState"
FROM_A_TO_B = ["a.out -> b.in"]


def motion(**rest):
    return Part("a", bonds=[BondSide(name="tip", side="motion", **rest)])


def force(**rest):
    return Part("b", bonds=[BondSide(name="tip", side="force", **rest)])


@pytest.mark.parametrize(
    ("source", "target", "message"),
    [
        (
            out(type=POSE),
            into(),
            "'a.out' gives geometry_msgs/msg/PoseStamped, 'b.in' takes std_msgs/msg/Float64MultiArray",
        ),
        (out(variability="event", type=TEXT), into(type=TEXT), "'a.out' gives events, 'b.in' takes a signal"),
        (out(unit="mm"), into(unit="m"), "'a.out' is in 'mm', 'b.in' takes 'm'"),
        (
            out(type=POSE, frame="PSM1_base"),
            into(type=POSE, frame="world"),
            "frame 'PSM1_base', 'b.in' takes frame 'world'",
        ),
        (out(size=3), into(size=4), "'a.out' has 3 numbers, 'b.in' takes 4"),
        (
            out(type=JOINTS, names=("x", "y")),
            into(type=JOINTS, names=("y", "x")),
            "'a.out' names x, y; 'b.in' takes y, x",
        ),
        (into("out"), into(), "'a.out' is an input, expected an output"),
        (out(), out("in"), "'b.in' is an output, expected an input"),
    ],
)
def test_ports_that_do_not_fit(source, target, message):
    with pytest.raises(ScenarioError, match=message) as raised:
        plan_of(Part("a", source), Part("b", target), connections=FROM_A_TO_B)
    assert raised.value.path[:2] == ("connections", 0)


def test_the_same_unit_in_other_words_fits():
    plan_of(Part("a", out(unit="N*s/m")), Part("b", into(unit="kg/s")), connections=FROM_A_TO_B)


@pytest.mark.parametrize(
    ("connection", "message"),
    [
        ("a.out -> c.in", "unknown participant 'c'.* Known: a, b"),
        ("a.ou -> b.in", r"no output 'ou'. Did you mean 'out'\?"),
        ("a.out -> b.inn", r"no input 'inn'. Did you mean 'in'\?"),
    ],
)
def test_names_that_are_not_there(connection, message):
    with pytest.raises(ScenarioError, match=message):
        plan_of(Part("a", out()), Part("b", into()), connections=[connection])


def test_an_input_is_fed_once():
    with pytest.raises(ScenarioError, match=r"input 'b.in' is fed twice, by 'a.out' and by 'a.other'"):
        plan_of(
            Part("a", out(), out("other")), Part("b", into()), connections=[*FROM_A_TO_B, "a.other -> b.in"]
        )


def test_a_queue_of_events_may_have_several_sources():
    parts = Part("a", out(), out("other")), Part("b", into(variability="event"))
    plan = plan_of(*parts, connections=[*FROM_A_TO_B, "a.other -> b.in"])
    assert [link.source_port for link in plan.connections] == ["out", "other"]
    with pytest.raises(ScenarioError, match=r"input 'b.in' is fed twice, by 'a.out' and by 'a.out'"):
        plan_of(*parts, connections=FROM_A_TO_B * 2)


def test_a_connection_is_named_once():
    with pytest.raises(
        ScenarioError, match=r"input 'b.in' is fed twice, by 'a.out' and by 'a.out'"
    ) as raised:
        plan_of(Part("a", out()), Part("b", into()), connections=FROM_A_TO_B * 2)
    assert raised.value.path == ("connections", 1)


def drives(*inputs):
    """A controller that drives two arms and shows a state, and a robot with `inputs`."""
    outputs = (out("state"), out("drive/PSM1/servo_jp"), out("drive/PSM1/jaw"), out("drive/PSM2/servo_jp"))
    return Part("motion", *outputs), Part(
        "robot", *(into(name, start=(0.0,)) for name in inputs), out("PSM1/jaw")
    )


def test_a_wildcard_joins_what_has_the_same_rest_of_the_name():
    parts = drives("PSM1/servo_jp", "PSM1/other", "PSM2/servo_jp", "state")
    plan = plan_of(*parts, connections=["motion.drive/* -> robot.*"])
    assert [(link.source_port, link.target_port) for link in plan.connections] == [
        ("drive/PSM1/servo_jp", "PSM1/servo_jp"),
        ("drive/PSM2/servo_jp", "PSM2/servo_jp"),
    ]
    plan = plan_of(*parts, connections=["motion.drive/PSM1/* -> robot.PSM2/*", "motion.* -> robot.*"])
    assert [(link.source_port, link.target_port) for link in plan.connections] == [
        ("drive/PSM1/servo_jp", "PSM2/servo_jp"),
        ("state", "state"),
    ]


def test_a_wildcard_that_joins_nothing_names_what_there_is():
    with pytest.raises(ScenarioError) as raised:
        plan_of(*drives("PSM3/servo_jp"), connections=["motion.drive/* -> robot.*"])
    assert raised.value.path == ("connections", 0)
    assert (
        str(raised.value)
        == "'motion.drive/* -> robot.*' connects nothing (outputs of 'motion': state, drive/PSM1/servo_jp,"
        " drive/PSM1/jaw, drive/PSM2/servo_jp; inputs of 'robot': PSM3/servo_jp)"
    )


def test_what_a_wildcard_joins_is_checked_like_any_connection():
    parts = drives("PSM1/servo_jp")
    with pytest.raises(ScenarioError, match=r"unknown participant 'robt'"):
        plan_of(*parts, connections=["motion.drive/* -> robt.*"])
    with pytest.raises(
        ScenarioError,
        match=(
            r"input 'robot.PSM1/servo_jp' is fed twice, by 'motion.state' and by 'motion.drive/PSM1/servo_jp'"
        ),
    ) as raised:
        plan_of(*parts, connections=["motion.state -> robot.PSM1/servo_jp", "motion.drive/* -> robot.*"])
    assert raised.value.path == ("connections", 1)
    with pytest.raises(
        ScenarioError, match=r"'motion.drive/PSM1/servo_jp' has 1 numbers, 'robot.PSM1/servo_jp' takes 2"
    ):
        plan_of(
            parts[0], Part("robot", into("PSM1/servo_jp", size=2)), connections=["motion.drive/* -> robot.*"]
        )


def test_a_signal_may_feed_an_event_port_whatever_its_size():
    target = into(type=JOINTS, variability="event")
    plan = plan_of(Part("a", out(type=JOINTS, names=("x", "y"))), Part("b", target), connections=FROM_A_TO_B)
    assert [link.target_port for link in plan.connections] == ["in"]
    with pytest.raises(ScenarioError, match=r"events cannot be extrapolated, as 'a.out -> b.in' would"):
        plan_of(
            Part("a", out(type=JOINTS)),
            Part("b", target),
            connections=[{"source": "a.out", "target": "b.in", "extrapolation": "linear"}],
        )


def test_an_input_without_a_source_needs_a_start_value():
    with pytest.raises(
        ScenarioError, match=r"input 'b.in' .* is not connected and has no start value"
    ) as raised:
        plan_of(Part("b", into()))
    assert raised.value.path == ("participants", "b")
    assert plan_of(Part("b", into(start=(0.0,)), into("words", type=TEXT, variability="event"))).order == (
        "b",
    )


def ring(*names):
    parts = [Part(name, out(), into()) for name in names]
    return parts, [
        f"{name}.out -> {following}.in" for name, following in zip(names, (*names[1:], names[0]), strict=True)
    ]


def test_a_cycle_needs_an_order():
    parts, connections = ring("a", "b", "c")
    with pytest.raises(
        ScenarioError,
        match=r"form a cycle among a, b, c: state the order in which they step, such as 'order: \[a, b, c\]",
    ):
        plan_of(*parts, connections=connections)
    with pytest.raises(ScenarioError, match="cycle"):
        plan_of(*parts, connections=connections, order=["b"])


@pytest.mark.parametrize("order", [["a", "b", "c"], ["c", "a", "b"], ["b", "a", "c"]])
def test_an_order_says_who_sees_whom_within_the_step(order):
    parts, connections = ring("a", "b", "c")
    plan = plan_of(*parts, connections=connections, order=order)
    assert plan.order == tuple(order)
    assert [link.fresh for link in plan.connections] == [
        order.index(link.source) < order.index(link.target) for link in plan.connections
    ]


def test_jacobi_makes_everything_late():
    parts, connections = ring("a", "b", "c")
    plan = plan_of(*parts, connections=connections, algorithm="jacobi")
    assert plan.order == ("a", "b", "c")
    assert not any(link.fresh for link in plan.connections)


def test_without_a_cycle_the_order_follows_the_connections_and_oneself_is_never_fresh():
    plan = plan_of(
        Part("last", into()),
        Part("first", out(), into("own")),
        connections=["first.out -> last.in", "first.out -> first.own"],
    )
    assert plan.order == ("first", "last")
    assert [link.fresh for link in plan.connections] == [True, False]


def test_an_order_names_participants():
    with pytest.raises(ScenarioError, match=r"unknown stepped participant 'b'\. .*Known: a") as raised:
        plan_of(Part("a", out()), Stylus("stylus", out()), order=["a", "b"])
    assert raised.value.path == ("order", 1)


def test_a_device_in_the_order_does_not_step():
    assert plan_of(Part("a", out()), Stylus("stylus", out()), order=["stylus", "a"]).order == ("a",)


def test_devices():
    age, tighter = 50_000_000, 20_000_000
    stylus = Stylus("stylus", out("pose", type=POSE, max_age_ns=age, clock="wall"), into("force", type=POSE))
    engine = Part("a", into(type=POSE, max_age_ns=tighter), into("other", type=POSE), out(type=POSE))
    plan = plan_of(
        stylus, engine, connections=["stylus.pose -> a.in", "stylus.pose -> a.other", "a.out -> stylus.force"]
    )
    assert [(inlet.target_port, inlet.max_age_ns) for inlet in plan.from_devices] == [
        ("in", tighter),
        ("other", age),
    ]
    assert [(outlet.source, outlet.target_port) for outlet in plan.to_devices] == [("a", "force")]
    assert plan.connections == plan.exchanging_devices() == ()
    assert plan.order == ("a",)
    with pytest.raises(ScenarioError, match="a device cannot feed a device"):
        plan_of(stylus, connections=["stylus.pose -> stylus.force"])


def test_simulated_time_is_the_hubs():
    with pytest.raises(ScenarioError, match="device 's' plays in simulated time") as raised:
        plan_of(Stylus("s", out()), specs={"s": {"host": "remote"}})
    assert raised.value.path == ("participants", "s", "host")
    plan = plan_of(
        Stylus("s", out(), out("other", clock="wall")),
        Stylus("t", out()),
        Stylus("u", into()),
        specs={"s": {"host": "remote"}},
    )
    assert [plan.participants[name].simulated_time for name in "stu"] == [False, True, False]


def test_only_vectors_are_extrapolated():
    with pytest.raises(ScenarioError, match="values of std_msgs/msg/String cannot be extrapolated"):
        plan_of(
            Part("a", out(type=TEXT)),
            Part("b", into(type=TEXT)),
            connections=[{"source": "a.out", "target": "b.in", "extrapolation": "linear"}],
        )


@pytest.mark.parametrize("period", ["1.5 ms", "0.5 ms"])
def test_periods_are_multiples_of_the_step(period):
    with pytest.raises(ScenarioError, match="is no multiple of the step 1 ms") as raised:
        plan_of(Part("a"), specs={"a": {"period": period}})
    assert raised.value.path == ("participants", "a", "period")


def test_the_period_of_an_output_is_a_multiple_of_the_participants():
    with pytest.raises(
        ScenarioError, match="output 'out' has a period of 3 ms, no multiple of the participant's 2 ms"
    ):
        plan_of(Part("a", out(period_ns=3_000_000)), specs={"a": {"period": "2 ms"}})
    plan = plan_of(Part("a", out(period_ns=6_000_000), out("each")), specs={"a": {"period": "2 ms"}})
    assert (plan.output_stride("a", "out"), plan.output_stride("a", "each")) == (6, 2)


@pytest.mark.parametrize(
    ("parts", "bond", "message"),
    [
        ((motion(), force()), {"motion": "c.tip"}, "unknown participant 'c'"),
        ((motion(), force()), {"motion": "a.top"}, r"'a' has no bond 'top'. Did you mean 'tip'\?"),
        ((motion(), force()), {"motion": "b.tip"}, "'b.tip' is a force side, expected a motion side"),
        ((motion(dof=3), force(dof=1)), {}, "'a.tip' has 3 degrees of freedom, 'b.tip' has 1"),
        ((motion(dof=1, coordinate="angle"), force(dof=1)), {}, "'a.tip' moves by angle, 'b.tip' by length"),
        ((motion(dof=3, points=4), force(dof=3)), {}, "'a.tip' bonds 4 points, 'b.tip' bonds 1"),
        (
            (motion(frame="world"), force(frame="base")),
            {},
            "'a.tip' is in frame 'world', 'b.tip' in frame 'base'",
        ),
        (
            (motion(), force()),
            {"algorithm": "gauss-seidel"},
            "needs the order of its two participants, such as 'order: \\[a, b\\]'",
        ),
        ((motion(), force()), {"algorithm": "gauss-seidel", "order": ["a", "c"]}, "needs the order"),
        (
            (motion(), force()),
            {"algorithm": "impulse-linearised"},
            "needs stiffness, damping and proxy mass, which 'b.tip' does not state",
        ),
    ],
)
def test_bonds_that_do_not_fit(parts, bond, message):
    with pytest.raises(ScenarioError, match=message) as raised:
        plan_of(*parts, bonds=[{"motion": "a.tip", "force": "b.tip", **bond}])
    assert raised.value.path[:2] == ("bonds", 0)


def test_the_force_side_takes_whole_steps_of_the_motion_side():
    bonds = [{"motion": "a.tip", "force": "b.tip"}]
    with pytest.raises(ScenarioError, match="the force side's period must be a multiple"):
        plan_of(motion(), force(), specs={"a": {"period": "2 ms"}, "b": {"period": "3 ms"}}, bonds=bonds)
    plan = plan_of(motion(), force(), specs={"b": {"period": "3 ms"}}, bonds=bonds)
    assert plan.order == ("b", "a")
    assert [(link.source_port, link.fresh) for link in plan.connections] == [
        ("tip/pose", False),
        ("tip/twist", False),
        ("tip/wrench", True),
    ]
    assert {port.name for port in plan.participants["a"].ports} == {"tip/pose", "tip/twist", "tip/wrench"}


@pytest.mark.parametrize(
    ("of", "message"),
    [
        ("c.out", "unknown participant 'c'"),
        ("a.in", "no output 'in' to measure"),
        ("a.out.force", r"'a.out' has no field 'force'. Known: angular, angular.x, .*, linear, linear.x"),
    ],
)
def test_measures_are_of_outputs(of, message):
    part = Part("a", out(type="geometry_msgs/msg/TwistStamped"), into(start=(0.0,)))
    with pytest.raises(ScenarioError, match=message) as raised:
        plan_of(part, measure={"top": {"kind": "peak", "of": of}})
    assert raised.value.path == ("measure", "top", "of")


def test_only_of_a_signal_is_measured_how_long_it_is_above_a_level():
    part = Part("a", out(type="std_msgs/msg/Float64", variability="event"))
    assert plan_of(part, measure={"top": {"kind": "peak", "of": "a.out"}})
    with pytest.raises(ScenarioError, match=r"'a.out' has no value between its events"):
        plan_of(part, measure={"top": {"kind": "time-above", "of": "a.out", "level": 1.0}})


def test_a_plan_survives_json():
    plan = plan_of(
        motion(),
        force(),
        Stylus("s", out()),
        Part("c", into()),
        connections=["s.out -> c.in"],
        bonds=[{"motion": "a.tip", "force": "b.tip"}],
    )
    assert Plan.model_validate_json(plan.model_dump_json()) == plan


def test_a_device_that_follows_the_clock_reads_as_a_participant_does():
    stylus, scripted = (
        Stylus("stylus", out("pose", type=POSE), into("force", type=POSE)),
        Stylus("scripted", out("pose", type=POSE)),
    )
    plan = plan_of(
        stylus,
        scripted,
        Part("a", into(type=POSE), out(type=POSE)),
        connections=["stylus.pose -> a.in", "a.out -> stylus.force"],
    )
    assert plan.to_devices == ()
    assert [(link.source, link.target, link.fresh) for link in plan.connections] == [("a", "stylus", False)]
    assert [planned.name for planned in plan.exchanging_devices()] == ["stylus"]
    assert plan.order == ("a",)


def test_nothing_is_extrapolated_for_a_device():
    stylus, engine = Stylus("stylus", out("pose", type=POSE), into("force", size=3)), Part("a", out(size=3))
    with pytest.raises(ScenarioError, match="'stylus' is a device, which receives values as they are"):
        plan_of(
            stylus,
            engine,
            connections=[{"source": "a.out", "target": "stylus.force", "extrapolation": "linear"}],
        )


def test_a_device_in_wall_time_is_read_at_a_rate_of_its_own():
    stylus = Stylus("stylus", out("pose", type=POSE, clock="wall"))
    assert plan_of(stylus).participants["stylus"].read_ns == 1_000_000
    planned = plan_of(stylus, specs={"stylus": {"period": "1.5 ms"}}).participants["stylus"]
    assert (planned.period, planned.read_ns) == (1, 1_500_000)
    with pytest.raises(ScenarioError, match=r"period 0.01 ms: a device is read every 0.1 ms at most"):
        plan_of(stylus, specs={"stylus": {"period": "0.01 ms"}})
    with pytest.raises(ScenarioError, match=r"period 1.5 ms is no multiple of the step 1 ms"):
        plan_of(Stylus("stylus", out("pose", type=POSE)), specs={"stylus": {"period": "1.5 ms"}})


def test_a_link_is_for_devices():
    link = {"preset": "100 ms", "loss": 0.01}
    device = plan_of(Stylus("s", out("pose", type=POSE)), specs={"s": {"network_link": link}})
    assert device.participants["s"].network_link.delay_ns == 100_000_000
    assert [planned.name for planned in device.exchanging_devices()] == ["s"]
    with pytest.raises(ScenarioError, match=r"but 'a' is no device \(engine\): remove it"):
        plan_of(Part("a", out()), specs={"a": {"network_link": link}})


@pytest.mark.parametrize("step_ns", [0, -1])
def test_a_plan_without_steps_is_refused(step_ns):
    nothing = dict.fromkeys(("order", "connections", "from_devices", "to_devices", "bonds"), ())
    with pytest.raises(ValidationError, match="greater than 0"):
        Plan.model_validate({"step_ns": step_ns, "participants": {}} | nothing)
