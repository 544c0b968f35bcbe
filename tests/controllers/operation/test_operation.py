"""The routine of the whole operation without physics: phases in their order, and exchanges between them."""

import numpy as np
import pytest

from controllers.operation.controller import Operation, Stage
from controllers.operation.ports import PHASES
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from robots.dvrk.inverse import inverse
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.errors import ScenarioError, StateError
from schemas.ros import Header, StringMessage
from schemas.trocar_msgs import TissueEvent

PERIOD = 10_000_000


class Theatre:
    """Arms that follow at once, no tissue yet, and an assistant who exchanges instruments in a second."""

    def __init__(self, *settings):
        given = load("cholecystectomy", [f"participants.routine.{setting}" for setting in settings])
        self.routine = Operation("routine", given.params["routine"])
        self.routine.configure(Setup(PERIOD, "."))
        self.arms = given.params["routine"].arms.present_arms
        self.bases = {part.grasper.arm: part.grasper.base for part in self.routine._parts}
        self.joints = {arm: np.array(params.start) for arm, params in self.arms.items()}
        self.instrument, self.wait, self.t = 0.0, -1, 0
        self.asked, self.said, self.jaws, self.errors = [], [], [], []

    @property
    def state(self):
        return self.routine.state

    @property
    def part(self):
        return self.routine._parts[self.state.phase]

    def step(self):
        values = {}
        for port in self.routine.ports:
            if port.causality == "input" and port.variability != "event":
                values[port.name] = np.zeros(port.size or 1) if "std_msgs" in port.type else None
        for arm, joints in self.joints.items():
            chain = self.arms[arm].chain
            values[f"{arm}/local/measured_cp"] = matrix_to_pose(chain.forward(joints))
            values[f"{arm}/measured_js"] = np.concatenate([joints, np.zeros(12)])
            values[f"{arm}/jaw/measured_js"] = np.zeros(3)
        values["PSM1/instrument"] = np.array([self.instrument])
        events = {"PSM2/error": tuple(StringMessage(data=text) for text in self.errors)}
        self.errors = []
        out = self.routine.step(self.t, PERIOD, Inputs(values, events=events))
        self.t += PERIOD
        self.said += [message.data for message in out["status"]]
        self.jaws += [float(message.position[0]) for message in out["PSM2/jaw/move_jp"]]
        for message in out["PSM2/servo_cp"]:
            place, turn = message.pose.position, message.pose.orientation
            goal = pose_to_matrix(np.array([place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w]))
            self.joints["PSM2"] = inverse(self.arms["PSM2"].chain, goal, self.joints["PSM2"])
        for message in out["PSM1/set_tool_type"]:
            self.asked.append(message.data)
            self.instrument, self.wait = -1.0, 100
        self.wait -= 1
        if self.wait == 0:
            self.instrument = float("CLIP" in self.asked[-1])
        return out

    def run(self, until, most=3000):
        for _ in range(most):
            if until():
                return
            self.step()
        raise AssertionError(self.said)


def test_each_phase_follows_the_last_one_with_its_instrument_and_the_grasper_at_rest():
    theatre = Theatre()
    rest = theatre.joints["PSM2"].copy()
    for phase in range(3):
        theatre.run(lambda: theatre.state.stage is Stage.WORK and theatre.state.begun)
        assert theatre.state.phase == phase
        assert theatre.instrument == float(phase == 1)
        assert np.allclose(theatre.joints["PSM2"], rest, atol=1e-3)
        tip = theatre.bases["PSM2"] @ theatre.arms["PSM2"].chain.forward(theatre.joints["PSM2"])
        tip[:3, 3] += [0.0, 0.0, -0.02]  # at work: farther in
        theatre.joints["PSM2"] = inverse(
            theatre.arms["PSM2"].chain,
            np.linalg.inv(theatre.bases["PSM2"]) @ tip,
            theatre.joints["PSM2"],
        )
        theatre.part.state.recoveries, theatre.part.state.done = 2, True
        theatre.step()
    assert theatre.routine.ended == "the gallbladder is out of its bed, after 6 recoveries"
    assert [said for said in theatre.said if "begins" in said] == [f"{phase}: begins" for phase in PHASES]
    assert theatre.asked == ["MEDIUM-LARGE_CLIP_APPLIER:420327[..]", "PERMANENT_CAUTERY_HOOK:400183[..]"]
    assert theatre.jaws
    assert min(theatre.jaws) > 0.5  # it lets go


def test_what_a_routine_cannot_do_ends_the_operation():
    theatre = Theatre()
    theatre.run(lambda: theatre.state.begun)
    theatre.errors.append("the arm is not homed")
    theatre.step()
    assert theatre.routine.ended == "given up: command refused: PSM2: the arm is not homed"


def test_clips_of_the_spare_applier_are_those_of_its_arm():
    theatre = Theatre()
    clipped = TissueEvent(
        header=Header(frame_id="world"), kind="clipped", instrument="PSM1_MEDIUM_LARGE_CLIP_APPLIER_420327"
    )
    theatre.state.phase = 1
    found = theatre.routine._translated(Inputs({}, events={"cystic_duct/events": (clipped,)}))
    assert found.events("cystic_duct/events")[0].instrument == "PSM1"


def test_a_saved_operation_goes_on_with_the_same_state():
    theatre = Theatre()
    theatre.run(lambda: theatre.state.begun)
    theatre.part.state.done = True
    theatre.step()
    again = Theatre()
    again.routine.restore(theatre.routine.save())
    again.joints, again.t = dict(theatre.joints), theatre.t
    for _ in range(60):
        theatre.step()
        again.step()
    assert theatre.routine.state_hash() == again.routine.state_hash()
    with pytest.raises(StateError):
        again.routine.restore(b"")


@pytest.mark.parametrize("setting", ["hook=PSM2", "hook=PSM3"])
def test_an_arm_without_hook_and_applier_is_refused(setting):
    with pytest.raises(ScenarioError, match="needs a cautery hook, and in `spares`, first, a clip applier"):
        load("cholecystectomy", [f"participants.routine.{setting}"])
