"""The driver of one participant: values stay, messages arrive once, silence lasts until it is taken back."""

import numpy as np
import pytest

from hub.participant import BondPlan, Controller, Inputs, Params, Setup
from hub.testing import Driver
from schemas.errors import MessageError, SessionError
from schemas.ports import Port
from schemas.ros import BoolMessage, StringMessage
from tests.hub.toys import Mass, MassParams


class Adder(Controller):
    """Adds its input at each step, unless that is stale; echoes words."""

    ports = (
        Port(name="step", causality="input", start=(1.0,)),
        Port(name="pose", causality="input", type="geometry_msgs/msg/PoseStamped", frame="world"),
        Port(name="word", causality="input", type="std_msgs/msg/String", variability="event"),
        Port(name="sum", causality="output"),
        Port(name="echo", causality="output", type="std_msgs/msg/String", variability="event"),
    )

    def configure(self, setup: Setup):
        self.sum, self.times, self.connected = np.zeros(1), [], setup.connected
        return {"sum": self.sum, "echo": ()}

    def step(self, t: int, h: int, inputs: Inputs):
        self.times.append((t, h))
        if not inputs.stale("step"):
            self.sum = self.sum + inputs["step"]
        return {"sum": self.sum, "echo": inputs.events("word")}


@pytest.fixture
def driver():
    return Driver(Adder("adder", Params()), period_ns=5)


def test_signals_begin_at_their_start_and_keep_what_is_set(driver):
    assert driver["sum"].tolist() == [0.0]
    assert driver.values["pose"].tolist() == [0.0] * 6 + [1.0]
    assert driver.step()["sum"].tolist() == [1.0]
    driver.set("step", 2.0)
    assert driver.step(2)["sum"].tolist() == [5.0]
    assert driver.participant.times == [(0, 5), (5, 5), (10, 5)]
    assert driver.time_ns == 15


def test_messages_arrive_in_the_next_step_alone_and_answers_of_a_call_are_kept(driver):
    one, other = StringMessage(data="one"), StringMessage(data="other")
    driver.send("word", one)
    driver.send("word", other)
    assert driver.step(3)["echo"] == ()
    assert driver.sent == {"echo": (one, other)}
    driver.send("word")
    driver.step()
    assert driver.sent == {}


def test_an_input_is_stale_until_the_next_call(driver):
    driver.stale("step", "word")
    assert driver.step(2)["sum"].tolist() == [0.0]
    driver.stale()
    assert driver.step()["sum"].tolist() == [1.0]


def test_inputs_given_at_the_start_are_connected():
    assert Driver(Adder("adder", Params())).participant.connected == frozenset()
    driver = Driver(Adder("adder", Params()), inputs={"step": 3.0})
    assert driver.participant.connected == {"step"}
    assert driver.step()["sum"].tolist() == [3.0]


@pytest.mark.parametrize(
    ("work", "error", "problem"),
    [
        (lambda d: d.set("stop", 1.0), SessionError, "no input signal 'stop'. Did you mean 'step'"),
        (lambda d: d.set("step", [1.0, 2.0]), MessageError, "step"),
        (lambda d: d.send("words", StringMessage()), SessionError, "Did you mean 'word'"),
        (lambda d: d.send("step", StringMessage()), SessionError, "no input port of events 'step'"),
        (lambda d: d.send("word", BoolMessage()), SessionError, "accepts std_msgs/msg/String, not std_msgs"),
        (lambda d: d.stale("sum"), SessionError, "no input port 'sum'"),
        (lambda d: d["summ"], SessionError, "no output 'summ'. Did you mean 'sum'"),
    ],
)
def test_what_does_not_fit_is_named(driver, work, error, problem):
    with pytest.raises(error, match=problem):
        work(driver)


def test_a_connected_bond_has_its_ports():
    plan = BondPlan(prediction="velocity", mean=True)
    with Driver(Mass("mass", MassParams()), bonds={"tip": plan}, inputs={"tip/force": [-2.0]}) as driver:
        assert driver.step(10)["tip/velocity"][0] == pytest.approx(-0.02)
