"""The expert in a world without physics: tips go where they are sent, and a shut jaw holds what it is at."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from controllers.expert import outlines
from controllers.expert.controller import Expert
from controllers.expert.hand import HandPhase, RobotHand
from controllers.expert.params import ExpertParams
from controllers.expert.peg_board import PegBoard
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from robots.dvrk.instruments import instrument
from robots.dvrk.psm import chain
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.errors import SessionError
from schemas.ros import StringMessage

PERIOD = 10_000_000


class World:
    """Two hands and the objects of an installed scenario."""

    clings = 0.0
    """A jaw lets go when it is opened further than this, rad."""

    def __init__(self, name, *, poses=None, **params):
        given = load(name, []).params["lead"]
        self.expert = Expert("lead", ExpertParams.model_validate(given.model_dump() | params))
        self.outputs = self.expert.configure(Setup(PERIOD, ".")) or {}
        self.objects = {index: pose_to_matrix(np.array(pose)) for index, pose in starts(name).items()} | (
            poses or {}
        )
        self.held, self.jaws, self.tips, self.grips, self.t = {}, {}, {}, {}, 0
        for each in self.expert._team.hands:
            hand = each.hand
            self.tips[hand.arm] = hand.base @ hand.chain.forward(
                np.array(given.arms.present_arms[hand.arm].start)
            )
            self.jaws[hand.arm] = 0.5

    def step(self, **events):
        values = {}
        for each in self.expert._team.hands:
            arm = each.hand.arm
            values[f"{arm}/local/measured_cp"] = matrix_to_pose(
                np.linalg.inv(each.hand.base) @ self.tips[arm]
            )
            wide = 0.1 if arm in self.grips and self.jaws[arm] < 0 else self.jaws[arm]
            values[f"{arm}/jaw/measured_js"] = np.array([wide, 0, 0])
        for index, pose in self.objects.items():
            holders = [float(arm[-1]) for arm, (name, _) in self.grips.items() if name == index]
            values[f"objects/{index}/pose"] = matrix_to_pose(pose)
            values[f"objects/{index}/held_by"] = np.array([min(holders, default=0.0)])
        out = self.expert.step(self.t, PERIOD, Inputs(values, events=events))
        self.t += PERIOD
        for each in self.expert._team.hands:
            self._follow(each.hand, out)
        return out

    def _follow(self, hand, out):
        arm = hand.arm
        for message in out[f"{arm}/jaw/move_jp"]:
            self.jaws[arm] = float(message.position[0])
            if self.jaws[arm] > self.clings:
                self.grips.pop(arm, None)
            if self.jaws[arm] < 0:
                near = [
                    index
                    for index, pose in self.objects.items()
                    if np.linalg.norm(pose[:3, 3] - self.tips[arm][:3, 3]) < 0.03
                ]
                if near:
                    near.sort(
                        key=lambda index: np.linalg.norm(self.objects[index][:3, 3] - self.tips[arm][:3, 3])
                    )
                    self.grips[arm] = near[0], np.linalg.inv(self.tips[arm]) @ self.objects[near[0]]
        for message in out[f"{arm}/servo_cp"]:
            p, q = message.pose.position, message.pose.orientation
            self.tips[arm] = hand.base @ pose_to_matrix(np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w]))
        if arm in self.grips:
            index, grip = self.grips[arm]
            self.objects[index] = self.tips[arm] @ grip

    def run(self, seconds, until=lambda world: world.expert.ended):
        for _ in range(round(seconds * 1e9 / PERIOD)):
            self.step()
            if until(self):
                return self
        return self


def starts(name):
    params = load(name, []).params["robot"]
    return {index: (*what.position, *what.orientation) for index, what in params.objects.items()}


@pytest.mark.long
@pytest.mark.parametrize("name", ["pick-and-place", "peg-board", "peg-board-surrol", "peg-board-fls"])
def test_everything_is_carried_where_it_belongs_at_the_first_attempt(name):
    world = World(name).run(120)
    assert world.expert.ended
    objects = len(world.objects)
    assert world.outputs["placed"][0] == objects
    assert world.outputs["attempts"][0] == objects * (2 if world.expert.params.hand_over else 1)
    assert world.outputs["dropped"][0] == 0


def test_what_is_lost_on_its_way_is_taken_up_again():
    world = World("peg-board-surrol")
    carrying = world.expert._team.hands[0]
    world.run(20, until=lambda _: carrying.state.phase is HandPhase.CARRY)
    index, _ = world.grips.pop("PSM1")
    world.objects[index] = pose_to_matrix(np.array(starts("peg-board-surrol")[index]))
    world.run(120)
    assert world.outputs["dropped"][0] == 1
    assert world.outputs["placed"][0] == len(world.objects)


def test_a_jaw_opens_further_until_nothing_clings_to_it():
    world = one_ring("peg-board-surrol")
    world.clings = 0.35
    world.run(30)
    assert world.jaws["PSM1"] == pytest.approx(0.4)
    assert (world.outputs["placed"][0], world.outputs["attempts"][0]) == (1, 1)


def test_a_ring_that_comes_along_when_the_hand_leaves_is_put_down_again_and_the_jaw_opens_further():
    world = one_ring("peg-board-surrol")
    hand = world.expert._team.hands[0]
    world.run(20, until=lambda _: hand.state.phase is HandPhase.RETREAT)
    world.grips["PSM1"] = "ring1", np.linalg.inv(world.tips["PSM1"]) @ world.objects["ring1"]
    put_down = world.objects["ring1"].copy()
    world.clings = 0.35
    world.run(20, until=lambda _: "PSM1" not in world.grips)
    assert world.jaws["PSM1"] == pytest.approx(0.4)
    assert world.objects["ring1"] == pytest.approx(put_down, abs=1e-4)


def test_a_hand_that_comes_down_on_something_backs_off_and_leaves_the_thing_after_some_times():
    world = one_ring("peg-board-surrol")
    hand, tip = world.expert._team.hands[0], world.tips
    struck = 0.0
    while not world.expert.ended:
        world.step()
        if hand.state.phase is HandPhase.DESCEND and tip["PSM1"][2, 3] < 0.830:
            struck = max(struck, 0.830 - tip["PSM1"][2, 3])
            tip["PSM1"][2, 3] = 0.830
    assert "ring1 is blocked" in world.expert.ended
    assert world.outputs["attempts"][0] == 0  # no jaw has closed
    assert struck < 4e-3


def test_a_ring_is_put_down_clear_of_those_beside_it():
    params = load("peg-board-fls", []).params["lead"]
    board = PegBoard(params.rings[:2], params.board)
    turned = pose_to_matrix(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]))
    beside = pose_to_matrix(np.array([*board.place(0, np.stack([turned, turned]), 1), 0.0, 0.0, 0.0, 1.0]))
    beside[:2, 3] += 2e-3
    for angle in np.linspace(0.0, 2.0, 9):
        carried = pose_to_matrix(np.array([*beside[:3, 3], 0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)]))
        place = board.place(0, np.stack([carried, beside]), 1)
        carried[:3, 3] = place
        ring = params.board.measures.ring
        assert (
            outlines.outline_gap(
                outlines.outline_of_ring(ring, carried), outlines.outline_of_ring(ring, beside)
            )
            >= 1e-3
        )


def one_ring(name, pose=None, **params):
    """A world with the first ring only, at `pose`, or where it starts."""
    objects = {"ring1": load(name, []).params["lead"].objects["ring1"].model_dump()}
    world = World(name, objects=objects, **params)
    world.objects = {"ring1": world.objects["ring1"] if pose is None else pose}
    return world


def fallen(x, y, z, turn=0.0):
    """The pose (m) of a ring that lies on its side."""
    c, s = np.cos(turn), np.sin(turn)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    pose[:3, 3] = x, y, z
    return pose


@pytest.mark.parametrize(
    ("name", "pose", "attempts"),
    [
        ("peg-board-surrol", fallen(0.105, 1.120, 0.8099), 2),
        ("peg-board", fallen(0.100, 1.135, 0.7849, 1.0), 3),
        ("peg-board", fallen(0.055, 1.140, 0.7849), 5),  # beyond the wall: over, and over again
    ],
)
def test_a_ring_that_lies_on_its_side_is_put_upright_first(name, pose, attempts):
    world = one_ring(name, pose).run(90)
    assert world.expert.ended == "the task is done"
    assert world.outputs["attempts"][0] == attempts
    assert abs(world.objects["ring1"][2, 2]) == pytest.approx(1.0, abs=0.01)


def test_rings_go_there_and_back():
    world = one_ring("peg-board", legs=2).run(90)
    assert world.expert.ended == "the task is done"
    assert world.objects["ring1"][0, 3] > 0.078  # on the surgeon's left again
    assert world.outputs["attempts"][0] == 4


def test_a_ring_at_the_end_of_an_arms_reach_is_taken_by_a_hand_that_leans():
    pose = np.eye(4)
    c, s = np.cos(0.497), np.sin(0.497)
    pose[:2, :2], pose[:3, 3] = [[c, -s], [s, c]], (0.1262, 1.1074, 0.8122)
    world = one_ring("peg-board-surrol", pose)
    world.run(20, until=lambda _: world.grips)
    assert 0.5 < -world.tips["PSM1"][2, 2] < 0.99
    assert world.run(20).expert.ended == "the task is done"


@pytest.mark.parametrize(
    ("pose", "why", "count"),
    [
        (fallen(0.105, 0.5, 0.810), "is not reachable", "not_reachable"),
        (fallen(0.105, 1.12, 0.5), "has fallen off the table", "lost"),
    ],
)
def test_what_cannot_be_taken_is_said_and_left(pose, why, count):
    world, said = one_ring("peg-board-surrol", pose), []
    while not world.expert.ended and world.t < 5e9:
        said += world.step()["status"]
    assert [message.data for message in said] == [f"ring1 {why}, at {position(pose)} mm"]
    assert world.expert.ended == f"nothing more can be done: {said[0].data}"
    assert (world.outputs[count][0], world.outputs["done"][0]) == (1, 0)


def position(pose):
    return f"({', '.join(f'{1e3 * x:.0f}' for x in pose[:3, 3])})"


def test_a_ring_that_slips_out_of_every_grasp_is_left_after_some():
    world = one_ring("peg-board-surrol")
    for _ in range(6000):
        world.grips.clear()
        if world.step() and world.expert.ended:
            break
    assert "ring1 is blocked" in world.expert.ended
    assert world.outputs["attempts"][0] == 8


def test_pieces_do_not_go_back():
    stated = load("pick-and-place", []).params["lead"].model_dump()
    with pytest.raises(ValidationError, match="only rings of a board go back"):
        ExpertParams.model_validate(stated | {"legs": 2})


def test_one_hand_alone_does_what_two_do():
    world = World("pick-and-place", hands=("PSM1",)).run(120)
    assert world.expert.ended


def test_a_saved_expert_goes_on_with_the_same_bits():
    world, other = World("peg-board"), World("peg-board")
    world.run(9)
    other.expert.restore(world.expert.save())
    for each in ("held", "jaws", "tips", "grips", "objects"):
        setattr(other, each, dict(getattr(world, each)))
    other.t = world.t
    world.run(3), other.run(3)
    assert world.expert.state_hash() == other.expert.state_hash()
    assert world.tips["PSM2"] == pytest.approx(other.tips["PSM2"], abs=0)


def test_a_hand_leaves_a_thing_after_a_command_on_the_way_to_it_was_refused():
    world = one_ring("peg-board-surrol").run(0.5)
    refused = {"PSM1/error": (StringMessage(data="too far"),)}
    world.step(**refused), world.step(**refused)
    assert "ring1 is not reachable" in world.run(10).expert.ended


def test_a_hand_whose_way_back_is_refused_stays_and_goes_on_with_the_next_thing():
    world = World("peg-board-surrol")
    hand = world.expert._team.hands[0]
    world.run(20, until=lambda _: hand.state.phase is HandPhase.RETREAT)
    world.run(0.05)
    before = world.tips["PSM1"].copy()
    world.step(**{"PSM1/error": (StringMessage(data="too far"),)})
    assert hand.state.phase is not HandPhase.RETREAT
    assert np.linalg.norm(world.tips["PSM1"][:3, 3] - before[:3, 3]) < 1e-3
    world.run(120)
    assert world.outputs["placed"][0] == len(world.objects)


def test_a_refused_command_to_a_hand_that_carries_ends_the_session():
    world = one_ring("peg-board-surrol")
    carrying = world.expert._team.hands[0]
    world.run(20, until=lambda _: carrying.state.phase is HandPhase.CARRY)
    with pytest.raises(SessionError, match="PSM1 in phase 'carry': too far"):
        world.step(**{"PSM1/error": (StringMessage(data="too far"),)})


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"hands": ("PSM3",)}, "PSM3 is no arm of the scene"),
        ({"hands": ("PSM1",), "hand_over": True}, "hand_over needs two hands"),
        ({"goals": {"piece9": "left"}}, "no object 'piece9'"),
        ({"goals": {"piece1": "lift"}}, "no dish 'lift'.*left"),
        ({"goals": {}}, "nothing to do"),
    ],
)
def test_a_task_that_cannot_be_done_is_refused(wrong, problem):
    stated = load("pick-and-place", []).params["lead"].model_dump()
    with pytest.raises(ValidationError, match=problem):
        ExpertParams.model_validate(stated | wrong)


@given(
    st.lists(st.floats(-0.1, 0.1), min_size=3, max_size=3),
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.floats(0.1, 1.0),
)
def test_a_line_starts_and_ends_at_rest_and_keeps_to_its_speed(way, turn, share):
    from robots import rotation

    tool = instrument("400006")
    hand = RobotHand("PSM1", np.eye(4), chain(tool), tool.jaw)
    hand.period = 0.01
    start = np.array([0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 1.0])
    hand.state.goal[:] = hand.state.start[:] = hand.measured[:] = start
    goal = np.concatenate([start[:3] + way, rotation.exp(np.array(turn))])
    hand.go(goal, share)
    line = [hand.line()[:3]]
    while not hand.has_arrived:
        hand.advance(settle=False)
        line.append(hand.line()[:3])
    assert line[-1] == pytest.approx(goal[:3])
    speed = np.linalg.norm(np.diff(line, axis=0), axis=1) / hand.period
    assert speed.max(initial=0.0) <= 0.12 * share * 1.01
    assert speed[0] < 0.25 * speed.max() + 1e-9
