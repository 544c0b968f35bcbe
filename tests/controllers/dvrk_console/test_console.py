"""The console stepped by hand: pedals, programs, arms, masters and teleoperations are events and vectors that
a test puts in.
"""

import numpy as np
import pytest

from controllers.dvrk_console.controller import DvrkConsole
from controllers.dvrk_console.params import DvrkConsoleParams
from devices.ros.params import GatewayParams
from devices.ros.topics.dvrk_table import dvrk_table
from hub.testing import Driver, check_engine
from robots import rotation
from schemas.crtk import OperatingState, StringStamped
from schemas.errors import StateError
from schemas.ros import BoolMessage, EmptyMessage, Float64Message, Joy, StringMessage

H = 2_000_000
PAIRS = ("MTMR_PSM1", "MTML_PSM2", "MTMR_PSM3")
READY = OperatingState(state="ENABLED", is_homed=True)
OFF = OperatingState(state="DISABLED")
DOWN, UP, TAP = (Joy(buttons=np.array([button], np.int32)) for button in (1, 0, 2))


class Rig:
    def __init__(self, **params):
        self.console = DvrkConsole(
            "console",
            DvrkConsoleParams.model_validate(
                {"arms": ["PSM1", "PSM2", "PSM3", "ECM"], "teleoperations": PAIRS, **params}
            ),
        )
        self.driver = Driver(self.console, period_ns=H)
        self.values = self.driver.values

    heard = property(lambda self: self.driver.sent)
    outputs = property(lambda self: self.driver.outputs)

    def step(self, events=(), count=1):
        """Step with events by port; `heard` is what was said since."""
        for port, value in dict(events).items():
            self.driver.send(port, *(value if isinstance(value, tuple) else (value,)))
        self.driver.step(count)
        return self

    def said(self, port):
        return [
            getattr(message, "data", getattr(message, "string", message))
            for message in self.heard.get(port, ())
        ]

    def buttons(self, port):
        return [message.buttons.tolist() for message in self.heard.get(port, ())]

    def ready(self, *names):
        return self.step(
            {
                f"{name}/operating_state": READY
                for name in names or ("PSM1", "PSM2", "PSM3", "ECM", "MTML", "MTMR")
            }
        )

    def led(self, pair="MTMR_PSM1"):
        """Until `pair` is led."""
        self.ready().step(
            {"console/teleop/enable": BoolMessage(data=True), "console/emulate_operator_present": DOWN}
        )
        return self.step({f"teleop/{pair}/state": StringMessage(data="ENABLED")})


def test_every_topic_of_the_console_in_the_table_is_there_with_its_type():
    told = {p.name: (p.type, p.variability) for p in Rig().console.ports if p.causality == "output"}
    heard = {p.name: (p.type, p.variability) for p in Rig().console.ports if p.causality == "input"}
    no_sound = {"system/beep", "system/string_to_speech"}
    for row in dvrk_table(GatewayParams.model_validate({"teleoperations": PAIRS, "cameras": []})):
        if (
            row.port is not None
            and row.owner in {"console", "system", "footpedals", *PAIRS}
            and row.port.name not in no_sound
        ):
            ours = told if row.way == "publish" else heard
            assert ours[row.port.name] == (row.type, row.port.variability), row.topic


def test_at_the_start_it_says_how_everything_is():
    rig = Rig(scale=0.3).step()
    assert rig.said("console/teleop/enabled") == [False]
    assert rig.said("console/teleop/scale") == [0.3]
    assert rig.said("console/teleop/selected") == ["MTMR_PSM1", "MTML_PSM2"]
    assert rig.said("console/teleop/unselected") == ["MTMR_PSM3"]
    assert rig.said("MTML_PSM2/current_state") == ["DISABLED"]
    assert rig.buttons("teleop/MTMR_PSM1/buttons") == [[1]]
    assert rig.outputs["teleop/MTMR_PSM1/gripper"].tolist() == [-1.0]
    assert rig.step().heard == {}


@pytest.mark.parametrize(
    ("order", "command"), [("power_on", "enable"), ("power_off", "disable"), ("home", "home")]
)
def test_the_system_orders_all_arms(order, command):
    rig = Rig(enabled=True)
    rig.step()
    rig.step({f"system/{order}": EmptyMessage()})
    assert [rig.said(f"{arm}/state_command") for arm in ("PSM1", "PSM2", "PSM3", "ECM")] == [[command]] * 4
    assert rig.said("console/teleop/enabled") == ([False] if order == "power_off" else [])


def test_enabling_homes_arm_and_master_then_aligns_then_leads():
    rig = Rig()
    rig.step({"PSM1/operating_state": OFF, "MTMR/operating_state": OperatingState(state="ENABLED")})
    rig.step({"console/teleop/enable": BoolMessage(data=True), "console/emulate_operator_present": DOWN})
    assert rig.said("MTMR_PSM1/desired_state") == ["ENABLED"]
    assert rig.said("MTMR_PSM1/current_state") == ["SETTING_ARMS_STATE"]
    assert rig.said("PSM1/state_command") == ["enable", "home"]
    assert rig.said("MTMR/state_command") == ["home"]
    turn = rotation.exp(np.array([0.2, -0.4, 0.1]))
    rig.values["MTMR/measured_cp"][:] = [0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]
    rig.values["PSM1/setpoint_cp"][3:] = turn
    rig.ready("PSM1", "MTMR")
    assert rig.said("MTMR_PSM1/current_state") == ["ALIGNING_MTM"]
    assert rig.buttons("teleop/MTMR_PSM1/buttons") == [[0]]
    (goal,) = rig.said("MTMR/move_cp")
    assert (goal.pose.position.x, goal.pose.position.z) == (0.1, 0.3)
    assert np.allclose([goal.pose.orientation.x, goal.pose.orientation.w], [turn[0], turn[3]])
    assert rig.said("MTMR_PSM1/alignment_offset")[0].quaternion == goal.pose.orientation
    rig.step(count=10)
    assert len(rig.said("MTMR/move_cp")) == 2  # every 10 ms
    rig.step({"teleop/MTMR_PSM1/state": StringMessage(data="ENABLED")})
    assert rig.said("MTMR_PSM1/current_state") == ["ENABLED"]
    assert rig.said("MTMR_PSM1/following") == [True]
    (wrench,) = rig.said("MTMR/body/servo_cf")
    assert wrench.wrench.force.x == 0.0
    assert rig.said("MTMR/use_gravity_compensation") == [True]
    assert "MTMR/unlock_orientation" in rig.heard
    assert rig.step(count=20).heard == {}


def test_an_arm_that_tells_how_it_is_only_later_is_homed_then():
    rig = Rig(enabled=True)
    rig.step({"console/emulate_operator_present": DOWN})
    assert "PSM1/state_command" not in rig.heard
    assert rig.step({"PSM1/operating_state": OFF}).said("PSM1/state_command") == ["enable", "home"]


def test_the_clutch_frees_the_hand_and_keeps_the_masters_orientation():
    rig = Rig().led()
    rig.step({"pedals/clutch": DOWN})
    assert (
        rig.buttons("teleop/MTMR_PSM1/buttons")
        == rig.buttons("footpedals/clutch")
        == rig.buttons("console/clutch")
        == [[1]]
    )
    assert rig.said("MTMR_PSM1/following") == [False]
    assert "MTMR_PSM1/current_state" not in rig.heard
    assert "MTMR/lock_orientation" in rig.heard
    rig.step({"teleop/MTMR_PSM1/state": StringMessage(data="CLUTCHED")}, count=10)
    assert "MTMR/move_cp" not in rig.heard
    rig.step({"pedals/clutch": UP})
    assert rig.said("MTMR_PSM1/current_state") == ["ALIGNING_MTM"]
    assert rig.buttons("teleop/MTMR_PSM1/buttons") == [[0]]
    assert Rig().led().step({"pedals/clutch": TAP}).buttons("teleop/MTMR_PSM1/buttons") == []


def test_the_camera_pedal_holds_the_arms_and_leads_the_endoscope():
    rig = Rig().led()
    rig.step({"pedals/camera": DOWN})
    assert rig.buttons("teleop/ECM/buttons") == [[1]]
    assert rig.buttons("teleop/MTMR_PSM1/buttons") == rig.buttons("teleop/MTML_PSM2/buttons") == [[1]]
    assert rig.said("MTMR_PSM1/current_state") == ["DISABLED"]
    assert "MTMR/hold" in rig.heard
    rig.step({"pedals/camera": UP})
    assert rig.buttons("teleop/ECM/buttons") == [[0]]
    assert rig.said("MTMR_PSM1/desired_state") == ["ENABLED"]


def test_an_endoscope_that_is_not_ready_is_homed_when_it_is_to_be_led():
    rig = Rig(enabled=True).step({"ECM/operating_state": OFF, "console/emulate_operator_present": DOWN})
    assert rig.step({"pedals/camera": DOWN}).said("ECM/state_command") == ["enable", "home"]


def test_a_surgeon_who_looks_up_holds_everything():
    rig = Rig().led()
    rig.step({"pedals/operatorpresent": UP})
    assert rig.said("MTMR_PSM1/desired_state") == ["ALIGNING_MTM"]
    assert rig.said("MTMR_PSM1/following") == [False]
    assert rig.buttons("teleop/MTMR_PSM1/buttons") == [[1]]


def test_an_arm_that_is_not_ready_any_more_is_not_led_until_somebody_asks():
    rig = Rig().led()
    rig.step({"PSM1/operating_state": OperatingState(state="FAULT", is_homed=True)})
    assert rig.said("MTMR_PSM1/warning") == [
        "MTMR_PSM1: PSM1 not ENABLED and homed any more; send state_command enable"
    ]
    assert rig.said("MTMR_PSM1/current_state") == ["DISABLED"]
    rig.ready()
    assert "MTMR_PSM1/current_state" not in rig.heard
    rig.step({"MTMR_PSM1/state_command": StringStamped(string="enable")})
    assert rig.said("MTMR_PSM1/current_state") == ["ENABLED"]


def test_a_master_leads_one_arm_and_takes_none_from_another():
    rig = Rig(teleoperations=[*PAIRS, "MTML_PSM1"])
    rig.step()
    rig.step({"console/teleop/select": StringMessage(data="MTMR_PSM3")})
    assert rig.said("console/teleop/selected") == ["MTML_PSM2", "MTMR_PSM3"]
    rig.step({"console/teleop/select": StringMessage(data="MTMR_PSM1")}).step(
        {"console/teleop/select": StringMessage(data="MTML_PSM1")}
    )
    assert rig.said("console/warning") == [
        "'MTML_PSM1' is not selected: PSM1 is led in 'MTMR_PSM1', unselect that first"
    ]
    rig.step({"console/teleop/unselect": StringMessage(data="MTMR_PSM1")}).step(
        {"console/teleop/select": StringMessage(data="MTML_PSM1")}
    )
    assert rig.said("console/teleop/selected") == ["MTML_PSM1"]
    assert (
        "Did you mean 'MTML_PSM2'"
        in rig.step({"console/teleop/select": StringMessage(data="MTML-PSM2")}).said("console/warning")[0]
    )


def test_scale_and_locks_reach_those_who_lead():
    rig = Rig()
    rig.step()
    rig.step({"console/teleop/set_scale": Float64Message(data=0.5)})
    assert rig.outputs["teleop/MTMR_PSM1/scale"].tolist() == [0.5]
    assert rig.said("console/teleop/scale") == rig.said("MTML_PSM2/scale") == [0.5]
    rig.step(
        {"MTML_PSM2/set_scale": Float64Message(data=0.1), "MTMR_PSM1/set_scale": Float64Message(data=2.0)}
    )
    assert (rig.outputs["teleop/MTML_PSM2/scale"][0], rig.outputs["teleop/MTMR_PSM1/scale"][0]) == (0.1, 0.5)
    assert rig.said("MTMR_PSM1/warning") == [
        "MTMR_PSM1: scale 2 is refused, allowed is above 0 and up to 1; it stays 0.5"
    ]
    rig.step(
        {
            "MTMR_PSM1/lock_rotation": BoolMessage(data=True),
            "MTMR_PSM1/set_align_MTM": BoolMessage(data=False),
        }
    )
    assert rig.said("MTMR_PSM1/rotation_locked") == rig.said("teleop/MTMR_PSM1/lock_rotation") == [True]
    assert rig.said("MTMR_PSM1/align_mtm") == [False]


@pytest.mark.parametrize(
    ("degrees", "gripper"), [(60.0, 1.0), (30.0, 0.5), (0.0, 0.0), (-5.0, 0.0), (80.0, 1.0)]
)
def test_a_gripper_opens_the_jaw(degrees, gripper):
    rig = Rig()
    rig.values["MTMR/gripper/measured_js"][0] = np.radians(degrees)
    rig.step()
    assert rig.outputs["teleop/MTMR_PSM1/gripper"][0] == pytest.approx(gripper)


@pytest.mark.parametrize(
    ("port", "message", "words"),
    [
        ("console/emulate_clutch", Joy(), "clutch: a Joy without a button is refused"),
        (
            "console/teleop/set_scale",
            Float64Message(data=0.0),
            "scale 0 is refused, allowed is above 0 and up to 1",
        ),
        ("system/set_volume", Float64Message(data=2.0), "volume 2 is refused, allowed are 0 to 1"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(port, message, words):
    assert words in Rig().step({port: message}).said("console/warning")[0]


def test_a_pedal_gives_power_while_it_is_held_and_an_operator_is_there():
    rig = Rig(energy={"PSM1": {"power": "25 W"}, "PSM2": {"pedal": "bicoag"}})
    watts = lambda: [float(rig.outputs[f"{arm}/energy"][0]) for arm in ("PSM1", "PSM2")]  # noqa: E731
    assert watts() == [0.0, 0.0]
    rig.step({"pedals/coag": DOWN})
    assert watts() == [0.0, 0.0]
    rig.step({"console/emulate_operator_present": DOWN}).step({"pedals/coag": DOWN})
    assert watts() == [25.0, 0.0]
    assert rig.buttons("footpedals/coag") == [[1]]
    rig.step({"pedals/coag": UP, "pedals/bicoag": DOWN})
    assert watts() == [0.0, 30.0]
    rig.step({"console/emulate_operator_present": UP})
    assert watts() == [0.0, 0.0]


def test_a_teleoperation_of_an_arm_that_is_not_there_is_refused():
    with pytest.raises(ValueError, match="'MTMR_PSM1' leads PSM1, which is not among the arms: PSM2"):
        DvrkConsoleParams.model_validate({"arms": ["PSM2"], "teleoperations": ["MTMR_PSM1"]})


def test_it_is_a_participant_whose_state_can_be_saved():
    check_engine(
        lambda: DvrkConsole(
            "console",
            DvrkConsoleParams.model_validate(
                {"arms": ["PSM1"], "teleoperations": ["MTMR_PSM1"], "enabled": True}
            ),
        ),
        period_ns=H,
    )
    with pytest.raises(StateError, match="participant 'console': a saved state of 1 bytes"):
        Rig().console.restore(b"0")
