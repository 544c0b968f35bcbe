"""`hub.testing` itself: our own participants pass, and each kind of breach is named."""

import random
from pathlib import Path

import numpy as np
import pytest

from controllers.teleoperation.controller import Teleoperation
from controllers.teleoperation.params import TeleoperationParams
from devices.scripted.device import ScriptedDevice, ScriptedParams
from engines.bullet.engine import BulletEngine
from engines.bullet.params import BulletParams
from engines.fmu.engine import FmuEngine, FmuParams
from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import BondPlan, ForceSide, Params, Sample, Stepped, state_hash
from hub.planning.scenario_file import installed_scenarios
from hub.testing import check_device, check_engine, run_in_process
from robots.dvrk import psm
from schemas.errors import StateError
from schemas.ports import BondSide, Port
from schemas.ros import Float64Message, Header, PoseStamped, StringMessage, Time
from tests.engines.fmus import build
from tests.hub.parts import Stylus, out
from tests.participants import make_participant

MS = 1_000_000


class TestOwnParticipants:
    def test_mujoco(self):
        params = MujocoParams.model_validate({"arms": {"PSM1": {}}})
        command = [*psm.HOME[:2], psm.HOME[2] + 0.01, *psm.HOME[3:]]
        inputs = {"PSM1/servo_jp": command, "PSM1/probe/wrench": [0.1, 0.2, 0.5, 0, 0, 0]}
        check_engine(lambda: MujocoEngine("robot", params), period_ns=MS, inputs=inputs)

    def test_bullet(self):
        block = {"size": ["80 mm", "60 mm", "20 mm"], "young_modulus": "10 kPa", "nodes": 75}
        params = BulletParams.model_validate({"organs": {"block": block}, "probes": {"probe": {}}})
        inputs = {"probe/pose": [0, 0, 5.2e-3, 0, 0, 0, 1], "probe/twist": [0.001, 0, -0.02, 0, 0, 0]}
        check_engine(lambda: BulletEngine("tissue", params), period_ns=4 * MS, inputs=inputs)

    @pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)
    def test_fmu(self, tmp_path):
        fmu = build.pack(
            "mass_spring_damper",
            build.compile_library("mass_spring_damper", tmp_path),
            tmp_path / "plant.fmu",
        )
        check_engine(lambda: FmuEngine("plant", FmuParams(path=fmu)), period_ns=MS, inputs={"F": 3.0})

    def test_teleoperation(self):
        check_engine(lambda: Teleoperation("teleop", TeleoperationParams()), period_ns=4 * MS)

    def test_scripted(self):
        configs = installed_scenarios()["palpation"].parent
        params = ScriptedParams.model_validate(
            {"samples": "data/palpation_hand"}, context={"directory": configs}
        )
        check_device(lambda: ScriptedDevice("stylus", params))

    @pytest.mark.parametrize(
        "plan", [BondPlan("velocity", mean=True), BondPlan("slope", mean=True), BondPlan("hold", mean=False)]
    )
    def test_the_masses_of_the_example(self, monkeypatch, plan):
        monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples" / "two_mass")
        mass = {"mass": 1.0, "stiffness": 10.0, "damping": 0.1, "x": 1.0}
        check_engine(
            lambda: make_participant("two_mass:Mass", "one", mass, Path()),
            period_ns=MS,
            inputs={"tip/force": [-2.0]},
            bonds={"tip": plan},
        )
        sprung = mass | {"x": 0.0, "coupling_stiffness": 100.0, "coupling_damping": 1.0}
        inputs = {"tip/position": [0.5], "tip/velocity": [0.2]}
        check_engine(
            lambda: make_participant("two_mass:SprungMass", "two", sprung, Path()),
            period_ns=MS,
            inputs=inputs,
            bonds={"tip": plan},
        )


class GoodParams(Params):
    seed: float = 0.25


class Good(Stepped):
    """Keeps the whole contract; what breaks a part of it is derived from it."""

    params_model = GoodParams
    bonds = (BondSide(name="tip", side="force", dof=1, stiffness=10.0, damping=1.0),)
    ports = (
        Port(name="taken", causality="input", size=2, start=(1.0, 2.0)),
        Port(name="given", causality="output", size=2),
        Port(name="words", causality="output", type=StringMessage.ros_type, variability="event"),
        Port(name="pose", causality="output", type=PoseStamped.ros_type, period_ns=2 * MS),
    )

    def configure(self, setup):
        self.x = np.full(2, self.params.seed)
        self.side = ForceSide(self.bonds[0], setup.bonds["tip"])
        return self.outputs(0) | {"tip/force": np.zeros(1)}

    def outputs(self, time_ns):
        return {
            "given": self.x.copy(),
            "words": (StringMessage(data="tick"),),
            "pose": np.array([0, 0, 0, 0, 0, 0, 1.0]),
        }

    def step(self, t, h, inputs):
        s = h * 1e-9
        self.x = self.x + s * inputs["taken"]
        self.side.begin(inputs, s)
        self.side.add(10.0 * self.side.position(0.5 * s), self.side.velocity(0.5 * s), 0.5 * s, s)
        return self.outputs(t + h) | self.side.result(10.0 * self.side.position(s), self.side.velocity(s))

    def state_hash(self):
        return state_hash(self.x, self.side.state)

    def save(self):
        return np.concatenate([self.x, self.side.state]).tobytes()

    def restore(self, state):
        self.x, self.side.state = np.split(np.frombuffer(state), [2])

    def close(self):
        self.closed = True


def check(kind):
    inputs = {"tip/velocity": [0.3], "tip/position": [0.1]} if kind.bonds else {}
    check_engine(lambda: kind("good", GoodParams()), period_ns=MS, inputs=inputs)


def test_an_engine_that_keeps_the_contract_passes():
    check(Good)


class _Breaches:
    """One class per breach; the docstring is what the message must say."""

    class PortsThatGrow(Good):
        """configure() does not change the ports"""

        @property
        def ports(self):
            return Good.ports + ((Port(name="late", causality="input"),) if hasattr(self, "x") else ())

    class SameNameTwice(Good):
        """port names are unique"""

        ports = (*Good.ports, Good.ports[0])

    class StartOfOtherSize(Good):
        """has one number for each of the port"""

        ports = (*Good.ports, Port(name="knob", causality="input", size=3, start=(1.0,)))

    class MissingAtConfigure(Good):
        """configure() returns every output, but 'given' is missing"""

        def configure(self, setup):
            return {name: value for name, value in super().configure(setup).items() if name != "given"}

    class MissingLater(Good):
        """step() returns every output, but 'given' is missing"""

        def step(self, t, h, inputs):
            return {name: value for name, value in super().step(t, h, inputs).items() if name != "given"}

    class Undeclared(Good):
        """also ['secret']"""

        def outputs(self, time_ns):
            return super().outputs(time_ns) | {"secret": np.zeros(1)}

    class WrongShape(Good):
        """float64 of shape (1,), expected float64 of shape (2,)"""

        def outputs(self, time_ns):
            return super().outputs(time_ns) | {"given": np.zeros(1)}

    class NotFinite(Good):
        """are finite"""

        def outputs(self, time_ns):
            return super().outputs(time_ns) | {"given": np.full(2, np.nan)}

    class ListOfEvents(Good):
        """'words' as a tuple of messages"""

        def outputs(self, time_ns):
            return super().outputs(time_ns) | {"words": [StringMessage(data="tick")]}

    class OtherMessage(Good):
        """gives std_msgs/msg/String on 'words', but also std_msgs/msg/Float64"""

        def outputs(self, time_ns):
            return super().outputs(time_ns) | {"words": (Float64Message(data=1.0),)}

    class Random(Good):
        """equal inputs give equal state hashes"""

        dice = np.random.default_rng(1)

        def step(self, t, h, inputs):
            outputs = super().step(t, h, inputs)
            self.x = self.x + self.dice.random()
            return outputs | {"given": self.x}

    class UnequalOutputs(Good):
        """equal inputs give equal outputs, but 'given'"""

        dice = np.random.default_rng(1)

        def outputs(self, time_ns):
            return super().outputs(time_ns) | {"given": self.dice.random(2)}

    class BlindHash(Good):
        """state_hash() changes with the state"""

        def state_hash(self):
            return 7

    class RestlessHash(Good):
        """state_hash() does not change while nothing is stepped"""

        asked = 0

        def state_hash(self):
            self.asked += 1
            return self.asked

    class NegativeHash(Good):
        """unsigned number of 64 bits"""

        def state_hash(self):
            return -1

    class DeafToH(Good):
        """step() advances by `h`"""

        bonds = ()

        def configure(self, setup):
            self.x = np.zeros(2)
            return self.outputs(0)

        def step(self, t, h, inputs):
            self.x = self.x + 1e-3 * inputs["taken"]
            return self.outputs(t)

        def state_hash(self):
            return state_hash(self.x)

        def save(self):
            raise StateError("cannot")

    class WritesToInputs(Good):
        """step() does not write to its inputs, but it changed 'taken'"""

        def step(self, t, h, inputs):
            outputs = super().step(t, h, inputs)
            inputs["taken"][0] += 1.0
            return outputs

    class ForgetsAPart(Good):
        """restore() brings back the state"""

        def restore(self, state):
            self.x = np.frombuffer(state)[:2]

    class WorkOfTheWrongSign(Good):
        """the work of bond 'tip' in a step is minus its force times the way of the other side"""

        def step(self, t, h, inputs):
            outputs = super().step(t, h, inputs)
            return outputs | {"tip/work": -outputs["tip/work"]}

    class NoWork(Good):
        """returns the work of a bond as one finite float64 under 'tip/work', but it is None"""

        def step(self, t, h, inputs):
            return {name: value for name, value in super().step(t, h, inputs).items() if name != "tip/work"}


BREACHES = [value for value in vars(_Breaches).values() if isinstance(value, type)]


@pytest.mark.parametrize("kind", BREACHES, ids=lambda kind: kind.__name__)
def test_each_breach_is_named(kind):
    with pytest.raises(AssertionError) as raised:
        check(kind)
    assert kind.__doc__ in str(raised.value)


def test_parameters_that_do_not_survive_json():
    with pytest.raises(AssertionError, match="parameters survive JSON"):
        check_engine(lambda: Good("good", GoodParams.model_construct(seed=None)), period_ns=MS)


def test_close_comes_before_configure_and_twice():
    class Fragile(Good):
        def close(self):
            del self.x

    with pytest.raises(AttributeError):
        check(Fragile)


def test_an_engine_that_cannot_save_passes():
    class Forgetful(Good):
        def save(self):
            raise StateError("cannot")

    check(Forgetful)


def test_a_participant_that_counts_its_steps_says_so():
    check_engine(lambda: _Breaches.DeafToH("good", GoodParams()), period_ns=MS, counts_steps=True)


def test_inputs_that_are_not_there_are_the_callers_mistake():
    with pytest.raises(AssertionError, match=r"there are no inputs \['takne'\]"):
        check_engine(lambda: Good("good", GoodParams()), period_ns=MS, inputs={"takne": [0.0]})


class Pen(Stylus):
    """A device that keeps the contract."""

    params_model = GoodParams

    def __init__(self, name="pen", params=None):
        super().__init__(
            name,
            out("pose", type=PoseStamped.ros_type, frame="pen_base"),
            Port(name="force", causality="input", size=2),
        )
        self.params = params or GoodParams()
        self.written = []

    def read(self, t):
        return [self.sample(t)]

    def sample(self, t, port="pose", frame="pen_base"):
        return Sample(port, PoseStamped(header=Header(stamp=Time.from_ns(t), frame_id=frame)))

    def write(self, port, value):
        self.written.append((port, value.tolist()))


def test_a_device_that_keeps_the_contract_passes():
    made = []
    check_device(lambda: made.append(Pen()) or made[-1], inputs={"force": np.ones(2)})
    assert set(map(str, made[-1].written)) == {"('force', [1.0, 1.0])"}


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (lambda self, t: [self.sample(t, port="posse")], r"one is of 'posse'"),
        (lambda self, t: [self.sample(t, port="force")], r"one is of 'force'"),
        (lambda self, t: [self.sample(10**9 - t)], "do not go back"),
        (lambda self, t: [self.sample(t, frame="elsewhere")], "frame 'elsewhere', expected 'pen_base'"),
        (lambda self, t: [Sample("pose", Float64Message(data=1.0))], "but also std_msgs/msg/Float64"),
    ],
)
def test_each_breach_of_a_device_is_named(read, message):
    kind = type("Bad", (Pen,), {"read": read})
    with pytest.raises(AssertionError, match=message):
        check_device(lambda: kind())


def test_a_run_in_this_process_gives_its_summary():
    summary = run_in_process(
        {
            "name": "alone",
            "step": "1 ms",
            "duration": "5 ms",
            "measure": {"end": {"kind": "final", "of": "good.given"}},
        },
        {"good": Plain()},
    )
    assert (summary.steps, summary.state, summary.recording) == (5, "done", None)
    assert summary.measures["end"] == pytest.approx(np.hypot(0.25 + 0.005, 0.25 + 0.010))


class Plain(Good):
    """Without a bond."""

    bonds = ()

    def __init__(self):
        super().__init__("good", GoodParams())

    def configure(self, setup):
        self.x = np.full(2, self.params.seed)
        return self.outputs(0)

    def step(self, t, h, inputs):
        self.x = self.x + h * 1e-9 * inputs["taken"]
        return self.outputs(t + h)

    def state_hash(self):
        return state_hash(self.x)


def test_a_device_in_simulated_time_returns_the_same_samples_again():
    chance = random.Random(1)

    class Fickle(Pen):
        def sample(self, t, port="pose", frame="pen_base"):
            return super().sample(t + chance.randrange(2), port, frame)

    with pytest.raises(
        AssertionError, match="the same samples for the same inputs, but two instances differ"
    ):
        check_device(Fickle)
