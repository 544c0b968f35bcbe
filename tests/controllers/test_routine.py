import numpy as np
import pytest
from pydantic import ValidationError

from controllers.routine import Routine, RoutineParams
from hub.testing import Driver, check_engine
from schemas.crtk import OperatingState
from schemas.errors import SessionError, StateError
from schemas.ros import StringMessage

H = 1_000_000
STEPS = [
    {"do": "state", "arm": "PSM1", "command": "home"},
    {"do": "wait", "time": "2 ms"},
    {
        "do": "together",
        "orders": [
            {"do": "jaw", "arm": "PSM1", "angle": "30 deg"},
            {"do": "move_cp", "arm": "PSM2", "position": ["10 mm", 0, "-0.1 m"], "orientation": [0, 0, 0, 1]},
        ],
    },
]


class Run:
    """A routine whose arms are played by hand."""

    def __init__(self, tmp_path, steps=STEPS, **params):
        self.routine = Routine("routine", RoutineParams.model_validate({"steps": steps, **params}))
        self.driver = Driver(self.routine, period_ns=H, directory=tmp_path)

    outputs = property(lambda self: self.driver.outputs)

    def step(self, **events):
        for name, message in events.items():
            self.driver.send(name.replace("__", "/"), message)
        self.driver.step()
        return self.driver.sent


def busy(value):
    return OperatingState(state="ENABLED", is_homed=True, is_busy=value)


def test_each_order_is_given_once_and_waited_for_until_the_arm_was_busy_and_is_not(tmp_path):
    run = Run(tmp_path)
    assert run.step()["PSM1/state_command"][0].string == "home"
    assert not run.step(PSM1__operating_state=busy(False))  # from before the order
    assert not run.step(PSM1__operating_state=busy(True))
    assert run.outputs["step"][0] == 0.0
    run.step(PSM1__operating_state=busy(False))
    assert run.outputs["step"][0] == 1.0
    for _ in range(3):
        assert not run.step()
    given = run.step()
    assert given["PSM1/jaw/move_jp"][0].position == pytest.approx([np.radians(30)])
    assert given["PSM2/move_cp"][0].header.frame_id == "PSM2_base"
    assert given["PSM2/move_cp"][0].pose.position.x == pytest.approx(0.01)
    run.step(PSM1__operating_state=busy(True), PSM2__operating_state=busy(True))
    run.step(PSM1__operating_state=busy(False))
    assert run.outputs["done"][0] == 0.0
    run.step(PSM2__operating_state=busy(False))
    assert run.outputs["done"][0] == 1.0
    assert not run.step()


@pytest.mark.parametrize("port", ["error", "warning"])
def test_a_refused_order_ends_the_session_with_the_controllers_words(tmp_path, port):
    run = Run(tmp_path)
    run.step()
    with pytest.raises(SessionError, match="step 0: PSM1: move_cp refused: too far"):
        run.step(**{f"PSM1__{port}": StringMessage(data="PSM1: move_cp refused: too far")})


def test_an_order_that_is_never_done_ends_the_session_and_names_the_arm(tmp_path):
    run = Run(tmp_path, limit="5 ms")
    for _ in range(6):
        run.step()
    with pytest.raises(SessionError, match=r"step 0: PSM1 not done within 0\.005 s"):
        run.step()


def test_a_restored_routine_goes_on_where_it_was(tmp_path):
    run, other = Run(tmp_path), Run(tmp_path)
    run.step()
    run.step(PSM1__operating_state=busy(True))
    other.routine.restore(run.routine.save())
    other.driver.time_ns = run.driver.time_ns
    for one in (run, other):
        one.step(PSM1__operating_state=busy(False))
    assert other.outputs["step"][0] == 1.0
    assert run.routine.state_hash() == other.routine.state_hash()
    with pytest.raises(StateError, match="3 bytes"):
        run.routine.restore(b"abc")


def test_it_keeps_the_contract_of_a_controller():
    steps = [{"do": "wait", "time": 0}, *STEPS]
    check_engine(
        lambda: Routine("routine", RoutineParams.model_validate({"steps": steps})),
        period_ns=H,
        counts_steps=True,
    )


@pytest.mark.parametrize(
    "step", [{"do": "jump"}, {"do": "jaw", "arm": "MTML", "angle": 0}, {"do": "together", "orders": []}]
)
def test_steps_that_mean_nothing_are_refused(step):
    with pytest.raises(ValidationError):
        RoutineParams.model_validate({"steps": [step]})


def test_a_jaw_with_a_roller_is_told_two_angles():
    step = RoutineParams.model_validate(
        {"steps": [{"do": "jaw", "arm": "PSM1", "angle": "-20 deg", "roll": "90 deg"}]}
    ).steps[0]
    port, message = step.message()
    assert port == "PSM1/jaw/move_jp"
    assert message.position == pytest.approx(np.radians([-20, 90]))


def test_power_lasts_from_its_order_to_the_next_one(tmp_path):
    watts = [{"do": "energy", "arm": "PSM1", "power": power} for power in ("30 W", 0)]
    run = Run(tmp_path, [watts[0], {"do": "wait", "time": "3 ms"}, watts[1]])
    found = []
    for _ in range(9):
        run.step()
        found.append(float(run.outputs["PSM1/energy"][0]))
    assert found[:5] == [30.0] * 5
    assert found[-1] == 0.0
    assert run.outputs["done"][0] == 1.0
    with pytest.raises(ValidationError, match="400"):
        RoutineParams.model_validate({"steps": [watts[0] | {"power": "1 kW"}]})


@pytest.mark.parametrize("what", ["suction", "irrigation"])
def test_suction_and_irrigation_last_from_their_order_to_the_next_one(tmp_path, what):
    shares = [{"do": what, "arm": "PSM1", "share": share} for share in (0.5, 0)]
    run = Run(tmp_path, [shares[0], {"do": "wait", "time": "3 ms"}, shares[1]])
    found = []
    for _ in range(9):
        run.step()
        found.append(float(run.outputs[f"PSM1/{what}"][0]))
    assert found[:5] == [0.5] * 5
    assert found[-1] == 0.0
    assert run.outputs["done"][0] == 1.0


def test_an_exchange_is_asked_for_in_the_words_of_the_robot(tmp_path):
    run = Run(tmp_path, [{"do": "exchange", "arm": "PSM1", "instrument": 400183}])
    run.step()
    assert [one.data for one in run.outputs["PSM1/set_tool_type"]] == ["PERMANENT_CAUTERY_HOOK:400183[..]"]


def test_a_clip_is_closed_once_and_awaits_nothing(tmp_path):
    run = Run(tmp_path, [{"do": "clip", "arm": "PSM1"}, {"do": "wait", "time": "2 ms"}])
    found = []
    for _ in range(6):
        run.step()
        found.append(len(run.outputs["PSM1/clip"]))
    assert sum(found) == 1
    assert run.outputs["done"][0] == 1.0
