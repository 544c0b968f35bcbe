"""What a CRTK client relies on, at the level of ports: busy edges, homing that takes time, latched commands,
what is told once.
"""

import numpy as np
import pytest

from robots.dvrk import arms
from robots.dvrk.arm_bodies import ENDOSCOPE_MASS
from robots.dvrk.dynamics import STANDARD_GRAVITY
from robots.dvrk.instruments import instrument, instruments
from robots.dvrk.kinematics_queries import KinematicsQueries
from robots.dvrk.tool_type import tool_type
from schemas.crtk import StringStamped
from schemas.ros import BoolMessage, Header, StringMessage, Time
from tests.controllers.motion.rig import CART, HOME, PSM1, Rig, cp, jp

GOAL = HOME + np.array([0.1, -0.1, 0.02, 0.2, 0.1, -0.1])
HERE = arms.chain("PSM1").forward(HOME)


class Client:
    """Waits as crtk_python_client does: for busy, then for not busy, each stamped after the command."""

    def __init__(self, rig):
        self.rig, self.newest = rig, -1

    def wait(self, most=20_000, **order):
        """Give an order and return how many steps it took until the arm was busy and then idle."""
        since, was_busy = self.rig.driver.time_ns, False
        for count in range(1, most):
            self.rig.step(1, **order)
            order = {}
            for told in self.rig.heard.get("PSM1/operating_state", ()):
                assert told.header.stamp.ns > self.newest
                self.newest = told.header.stamp.ns
                assert self.newest > since
                was_busy |= told.is_busy
                if was_busy and not told.is_busy:
                    return count
        raise AssertionError("still waiting")


def command(text, stamp=0):
    return StringStamped(header=Header(stamp=Time.from_ns(stamp)), string=text)


@pytest.mark.parametrize(
    "order", [{"move_jp": jp(*HOME)}, {"move_jr": jp(*[0.0] * 6)}, {"jaw__move_jp": jp(0.0)}]
)
def test_a_hundred_moves_to_where_the_arm_is_are_each_busy_and_then_idle(order):
    client = Client(Rig().step())
    assert {client.wait(**order) for _ in range(100)} == {2}


def test_moves_after_one_another_all_arrive():
    client = Client(Rig().step())
    for _ in range(4):
        assert client.wait(move_jp=jp(*GOAL)) > 100
        assert client.wait(move_cp=cp([*HERE[:3, 3], 0.70710678, 0.70710678, 0, 0], "PSM1_base")) > 100


def test_a_move_that_takes_another_over_before_it_is_waited_for_leaves_nobody_waiting():
    client = Client(Rig().step())
    client.rig.step(1, move_jp=jp(*GOAL))
    client.newest = client.rig.driver.time_ns
    assert client.wait(move_jp=jp(*HOME)) > 1


@pytest.mark.parametrize("state", ["homed", "disabled"])
@pytest.mark.parametrize(
    "order",
    [
        {"move_jp": jp(*[9.0] * 6)},
        {"move_cp": cp([0, 0, -0.9, 0.70710678, 0.70710678, 0, 0])},
        {"jaw__move_jp": jp(9.0)},
    ],
)
def test_a_client_that_asks_whether_the_arm_is_busy_since_a_move_that_is_refused_learns_that_it_is_not(
    order, state
):
    rig = Rig(initial_state=state).step()
    since = rig.driver.time_ns
    rig.step(1, **order)
    (told,) = rig.heard["PSM1/operating_state"]
    assert told.header.stamp.ns > since
    assert not told.is_busy


@pytest.mark.parametrize("start", [HOME, GOAL])
@pytest.mark.parametrize("power_time", ["0 s", "100 ms"])
def test_homing_takes_time_even_where_the_arm_is_at_home(start, power_time):
    rig = Rig(
        {"PSM1": {"instrument": "400006", "start": start}}, initial_state="disabled", power_time=power_time
    ).step()
    assert Client(rig).wait(state_command=command("home")) > 1
    assert rig.states()[-1] == ("ENABLED", True, False)


def test_two_hundred_times_disabled_and_homed():
    client = Client(Rig(initial_state="disabled", power_time="3 ms").step())
    for _ in range(200):
        client.wait(state_command=command("home", client.rig.driver.time_ns + 1))
        for text in ("disable", "unhome"):
            client.rig.step(1, state_command=command(text, client.rig.driver.time_ns + 1))
            client.newest = client.rig.driver.time_ns


class TestLatchedCommands:
    def test_one_that_comes_again_is_not_heeded_again(self):
        rig = Rig(initial_state="disabled").step()
        home = command("home", stamp=1_700_000_000_123_456_789)
        Client(rig).wait(state_command=home)
        rig.step(1, state_command=command("disable", 1_700_000_050_000_000_000))
        rig.step(200, state_command=home)
        assert rig.said("warning") == [
            "PSM1: state_command 'home' of time 1700000000.123456789 s is refused: it was executed before; a"
            " new one has a new stamp"
        ]
        assert not rig.states()
        assert rig.mode == [0, 0]

    def test_a_new_one_of_the_same_words_is_heeded_and_so_are_those_without_a_stamp(self):
        rig = Rig(initial_state="disabled").step()
        for stamp in (10, 20, 0, 0):
            rig.step(1, state_command=command("home", stamp))
            assert rig.states() == [("DISABLED", stamp != 10, True)]
            rig.until_idle().step(1, state_command=command("disable"))
            assert rig.states() == [("DISABLED", True, False)]

    def test_different_commands_of_the_same_time_are_all_heeded(self):
        rig = (
            Rig(initial_state="disabled")
            .step()
            .step(1, state_command=(command("enable", 10), command("home", 10)))
        )
        assert not rig.said("warning")
        assert rig.until_idle().states() == [("ENABLED", True, False)]

    def test_they_are_remembered_over_a_checkpoint(self):
        rig = Rig().step().step(1, state_command=command("pause", 10))
        other = Rig()
        other.motion.restore(rig.motion.save())
        other.driver.time_ns = rig.driver.time_ns
        other.step(1, state_command=command("resume", 20)).step(1, state_command=command("pause", 10))
        assert "executed before" in other.said("warning")[0]

    def test_one_that_the_state_refused_may_come_again(self):
        rig = Rig().step().step(1, state_command=command("resume", 10))
        assert "refused in state ENABLED" in rig.said("warning")[0]
        rig.command("pause").step(1, state_command=command("resume", 10))
        assert rig.states()[-1][0] == "ENABLED"


def test_the_desired_state_is_told_at_time_0_and_with_each_command():
    rig = Rig(initial_state="disabled").step()
    assert rig.said("desired_state") == ["DISABLED"]
    for text, told in [("home", "HOMED"), ("enable", "ENABLED"), ("disable", "DISABLED"), ("home", "HOMED")]:
        assert rig.command(text).said("desired_state") == [told]
    rig.until_idle()
    assert rig.command("pause").said("desired_state") == ["PAUSED"]
    assert rig.command("resume").said("desired_state") == ["HOMED"]
    assert rig.command("unhome").said("desired_state") == []
    rig.follows = False
    rig.sensed["sense/PSM1/measured_js"][0] = 0.6
    assert rig.step().said("desired_state") == ["FAULT"]
    assert rig.command("disable").said("desired_state") == ["DISABLED"]
    assert Rig().step().said("desired_state") == ["HOMED"]


def test_what_an_arm_holds_is_told_once_at_time_0():
    rig = Rig({**CART, "PSM3": {"instrument": "MUSHA_HAND"}, "ECM": {"endoscope": "up"}}).step()
    assert rig.said("tool_type") == ["LARGE_NEEDLE_DRIVER:400006[..]"]
    assert rig.said("tool_type", "PSM3") == ["MUSHA_HAND"]
    assert rig.said("endoscope_type", "ECM") == ["Classic_SD_UP"]
    rig.step(200, state_command=command("disable"))
    assert not rig.said("tool_type")
    assert {
        port.name for port in rig.motion.ports if port.name.endswith("_type") and port.causality == "output"
    } == {f"PSM{i}/tool_type" for i in (1, 2, 3)} | {"ECM/endoscope_type"}


@pytest.mark.parametrize(
    ("order", "reason"),
    [
        ({"set_tool_type": StringMessage(data="LARGE_NEEDLE_DRIVER:400006")}, None),
        (
            {"set_tool_type": StringMessage(data="CADIERE_FORCEPS:400049[..]")},
            "'CADIERE_FORCEPS:400049[..]', the arm holds LARGE_NEEDLE_DRIVER:400006[..]",
        ),
        ({"emulate_tool_present": BoolMessage(data=True)}, None),
        ({"emulate_tool_present": BoolMessage(data=False)}, "which cannot be removed"),
        ({"emulate_adapter_present": BoolMessage(data=False)}, "which cannot be removed"),
    ],
)
def test_what_an_arm_holds_is_not_a_client_s_to_change(order, reason):
    rig = Rig(initial_state="disabled").step().step(1, **order)
    if reason is None:
        assert not rig.said("error")
        assert rig.said("tool_type") == (
            ["LARGE_NEEDLE_DRIVER:400006[..]"] if "set_tool_type" in order else []
        )
    else:
        assert reason in rig.said("error")[0]


def test_every_instrument_has_a_name_of_its_own_in_the_real_system_s_form():
    names = [tool_type(each) for each in instruments().values()]
    assert len(set(names)) == len(names)
    assert tool_type(instrument("LARGE_NEEDLE_DRIVER_420006_GEARED")) == "LARGE_NEEDLE_DRIVER:420006[12..]"
    assert tool_type(instrument("420093")) == "PROGRASP_FORCEPS:420093[..13]"


class TestKnownWeight:
    MG = ENDOSCOPE_MASS["Classic_SD"] * STANDARD_GRAVITY

    def told(self, rig, arm="ECM"):
        return rig.step(10).outputs[f"{arm}/gravity_compensation/setpoint_js"].copy()

    def test_an_upright_ecm_bears_the_endoscope_with_its_insertion_alone(self):
        rig = Rig({"ECM": {}}, mounting="free")
        assert np.allclose(self.told(rig), [0, 0, -self.MG, 0], atol=1e-9)  # the insertion goes down

    def test_it_is_the_effort_of_virtual_work_at_the_endoscope_s_centre(self):
        q = np.array([0.3, 0.4, 0.11, 0.2])
        rig = Rig({"ECM": {"start": q}})
        base, chain = rig.motion._camera_stand, arms.chain("ECM")

        def height(at):
            carriage = base @ chain.frames(at)[2]
            return (carriage[:3, 3] - 0.1 * carriage[:3, 2])[2]

        expected = [self.MG * (height(q + step) - height(q - step)) / 2e-6 for step in 1e-6 * np.eye(4)]
        assert np.allclose(self.told(rig), expected, atol=1e-6)

    def test_it_is_0_switched_off_and_without_power_and_for_a_psm(self):
        rig = Rig(CART)
        assert self.told(rig).any()
        assert not self.told(rig, "PSM1").any()
        rig.step(1, ECM__use_gravity_compensation=BoolMessage(data=False))
        assert not self.told(rig).any()
        rig.step(
            1, ECM__use_gravity_compensation=BoolMessage(data=True), ECM__state_command=command("disable")
        )
        assert not self.told(rig).any()


@pytest.mark.parametrize("arm", CART)
def test_the_kinematics_services_agree_with_what_is_told(arm):
    """With the base frame from `SUJ/<arm>/measured_cp` `forward_kinematics` gives `measured_cp`, and
    `inverse_kinematics` leads back from `local/`.
    """
    rig = Rig(CART).step(10)
    told = {
        name: rig.outputs[f"{arm}/{name}"] for name in ("measured_js", "measured_cp", "local/measured_cp")
    }
    queries, jp_told = (
        KinematicsQueries(arms.chain(arm)),
        told["measured_js"][: told["measured_js"].size // 3],
    )
    assert np.allclose(
        queries.forward(jp_told, rig.outputs[f"SUJ/{arm}/measured_cp"]).value, told["measured_cp"], atol=1e-12
    )
    assert np.allclose(queries.forward(jp_told).value, told["local/measured_cp"], atol=1e-12)
    assert np.allclose(queries.inverse(told["local/measured_cp"], jp_told + 0.01).value, jp_told, atol=1e-9)


READ = """
operating_state desired_state goal_reached error warning status measured_js setpoint_js measured_cp
setpoint_cp measured_cv local/measured_cp local/setpoint_cp local/measured_cv body/measured_cf
spatial/measured_cf body/jacobian spatial/jacobian gravity_compensation/setpoint_js
trajectory_j/ratio trajectory_j/ratio_v trajectory_j/ratio_a jaw/measured_js jaw/setpoint_js
tool_type
"""
WRITTEN = """
state_command hold free servo_jp servo_jr servo_jf servo_cp servo_cr servo_cs servo_ci body/servo_cf
spatial/servo_cf move_jp move_jr move_cp use_gravity_compensation body/set_cf_orientation_absolute
set_base_frame trajectory_j/set_ratio trajectory_j/set_ratio_v trajectory_j/set_ratio_a jaw/servo_jp
jaw/move_jp jaw/servo_jf set_tool_type emulate_tool_present emulate_adapter_present
"""


@pytest.mark.parametrize(("names", "causality"), [(READ, "output"), (WRITTEN, "input")])
def test_what_the_real_system_publishes_and_subscribes_to_is_there(names, causality):
    """What jhu-cisst/cisst-ros bridges of a PSM of sawIntuitiveResearchKit; services, and buttons of the arm
    itself, aside.
    """
    ports = {port.name: port.causality for port in Rig(PSM1).motion.ports}
    assert {name for name in names.split() if ports.get(f"PSM1/{name}") != causality} == set()
