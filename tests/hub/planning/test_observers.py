"""Who only looks on in real time, and who is in lock-step because of whom."""

import pytest

from hub.planning.plan import Plan
from schemas.ports import BondSide
from tests.hub.parts import Part, Stylus, into, out, plan_of

TEXT = "std_msgs/msg/String"
WALL = {"type": TEXT, "clock": "wall"}


class Camera(Part):
    observer = True


def camera(name="camera", **rest):
    return Camera(
        name, into(), into("more", variability="event"), out(type=TEXT, variability="event"), **rest
    )


def robot(*ports):
    return Part("robot", out(), *ports)


def gateway():
    return Stylus("gateway", into(type=TEXT, variability="event"), out(**WALL))


def planned(*parts, connections=("robot.out -> camera.in",), pace="realtime", **rest):
    return plan_of(*parts, connections=list(connections), pace=pace, **rest)


def test_a_camera_for_a_gateway_is_an_observer_and_in_no_order():
    links = ["robot.out -> camera.in", "camera.out -> gateway.in"]
    plan = planned(robot(), camera(), gateway(), connections=links, order=["robot", "camera"])
    assert plan.order == ("robot",)
    assert [one.name for one in plan.observers()] == ["camera"]
    assert not plan.connections
    assert [(link.source, link.target) for link in plan.to_devices] == [
        ("robot", "camera"),
        ("camera", "gateway"),
    ]
    assert plan.participants["camera"].lock_step == ""
    assert plan.find_contradiction() == ""


FEEDS = ["robot.out -> camera.in", "camera.out -> servoing.in"]


@pytest.mark.parametrize(
    ("others", "connections", "rest", "reason"),
    [
        ([], FEEDS[:1], {"pace": "fast"}, "pace fast"),
        (
            [Part("servoing", into(type=TEXT, variability="event"))],
            FEEDS,
            {},
            "it feeds servoing.in",
        ),
        (
            [Stylus("servoing", into(type=TEXT, variability="event"), out())],
            FEEDS,
            {},
            "it feeds servoing.in",
        ),
        (
            [Stylus("hand", out(clock="wall"))],
            ["hand.out -> camera.in"],
            {},
            "it reads hand.out, a device",
        ),
        ([], [*FEEDS[:1], "robot.out -> camera.more"], {}, "it takes every message of robot.out"),
        (
            [],
            [{"source": "robot.out", "target": "camera.in", "extrapolation": "linear"}],
            {},
            "it extrapolates robot.out",
        ),
    ],
)
def test_one_that_is_waited_for_is_in_lock_step_and_the_plan_says_why(others, connections, rest, reason):
    plan = planned(robot(), camera(), *others, connections=connections, **rest)
    assert "camera" in plan.order
    assert not plan.observers()
    assert plan.participants["camera"].lock_step == reason


def test_one_that_has_nothing_to_follow_or_a_bond_is_in_lock_step():
    plan = planned(robot(), Camera("camera", into(start=(0.0,))), connections=[])
    assert plan.participants["camera"].lock_step == "it has no input that it could follow"
    bonds = [{"motion": "camera.tip", "force": "robot.tip", "algorithm": "impulse"}]
    side = {"name": "tip", "dof": 1}
    plan = planned(
        Part("robot", out(), bonds=[BondSide(side="force", **side)]),
        camera(bonds=[BondSide(side="motion", effective_mass=1.0, **side)]),
        bonds=bonds,
    )
    assert plan.participants["camera"].lock_step == "it has a bond"


def test_any_other_kind_has_no_reason():
    plan = planned(robot(), Part("camera", into()))
    assert plan.order == ("robot", "camera")
    assert plan.participants["camera"].lock_step == ""


@pytest.mark.parametrize(
    ("hosts", "expected"),
    [
        ({}, "camera"),
        ({"camera": "cameras"}, "cameras"),
        ({"camera": "cameras", "robot": "cameras"}, "camera"),
        ({"robot": "camera"}, "camera_"),
        ({"camera": "remote"}, "remote/camera"),
    ],
)
def test_it_shares_its_process_with_observers_alone(hosts, expected):
    plan = planned(robot(), camera(), specs={name: {"host": host} for name, host in hosts.items()})
    assert plan.participants["camera"].host == expected
    assert plan.participants["robot"].host == hosts.get("robot", "hub")


def test_two_cameras_of_one_host_stay_together():
    links = ["robot.out -> camera.in", "robot.out -> room.in"]
    specs = {name: {"host": "cameras"} for name in ("camera", "room")}
    plan = planned(robot(), camera(), camera("room"), connections=links, specs=specs)
    assert {one.host for one in plan.observers()} == {"cameras"}


def test_the_plan_of_an_earlier_recording_has_none():
    plan = planned(robot(), camera(), pace="fast")
    old = plan.model_dump(mode="json")
    for one in old["participants"].values():
        del one["observer"], one["lock_step"]
    loaded = Plan.model_validate(old)
    assert loaded.observers() == ()
    assert loaded.order == plan.order
