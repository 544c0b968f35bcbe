"""The dissection routine without physics: to the end, and after everything that goes wrong."""

import numpy as np
import pytest

from controllers.cholecystectomy.obstacles import Obstacles
from controllers.dissection.step import Failure, Step
from hub.planning.scenario_file import load
from robots.transform import pose_to_matrix
from schemas.errors import MotionError, ScenarioError
from tests.controllers.dissection.world import PERIOD, Triangle, World


@pytest.mark.long
def test_the_whole_plate_is_freed_from_the_free_end_on_and_power_is_on_at_tissue_alone():
    world = World().run(80.0)
    assert world.state.done
    assert not len(world.ties)
    assert world.tip("PSM2")[2, 3] - world.state.begun[2] > 0.01  # lifted off the bed
    assert world.routine.ended == "cystic_plate is free (all), after 0 recoveries"
    assert world.state.ahead @ [0.0, 1.0, 0.0] > 0.95
    assert world.state.normal @ [0.0, 0.0, 1.0] > 0.95
    on = sum(power > 0.0 for power in world.powers) * PERIOD * 1e-9
    assert 0.5 * 60.0 * on == pytest.approx(world.delivered, rel=0.02)  # no power in the air
    assert world.powers[-1] == 0.0
    at_rest = world.tip("PSM1")[:3, 3] - world.state.rests[0, :3]
    assert np.linalg.norm(at_rest) < 1e-3


def test_a_lower_third_is_enough_where_it_is_all_that_is_wanted():
    world = World("part=lower third").run(60.0)
    assert world.state.done
    assert len(world.ties) == 6
    assert (world.ties[:, 1] > 0.035).all()


@pytest.mark.long
def test_a_missed_grasp_is_tried_again_and_then_given_up():
    world = World()
    world.misses = 1
    world.run(80.0)
    assert world.state.done
    assert world.state.recoveries == 1
    world = World("attempts=2")
    world.misses = 9
    world.run(30.0)
    assert world.state.failure is Failure.GRASP_MISSED
    assert world.routine.ended == "given up: grasp missed: nothing is held, 2 attempts"


def test_a_gallbladder_that_slips_away_is_grasped_again_with_the_hook_out_of_the_gap():
    world = World()
    while world.state.step is not Step.BURN:
        world.step()
    world.held = False
    world.step()
    assert world.state.step is Step.AIM_GRASP
    assert world.powers[-1] == 0.0
    world.run(90.0)
    assert world.state.done
    assert world.state.recoveries == 1


def test_a_place_that_does_not_part_is_left_for_the_next_and_given_up_when_all_are_tried():
    world = World("attempts=1", "patience=1 s")
    world.stubborn[:] = world.ties[:, 1] > 0.06
    world.run(120.0)
    assert world.state.failure is Failure.NOT_PARTED
    assert world.routine.ended == "given up: not parted: 2 places hang together"


def test_a_refused_command_ends_with_its_reason():
    world = World()
    world.refused.append(("PSM1", "the arm is not homed"))
    world.step()
    assert world.routine.ended == "given up: command refused: PSM1: the arm is not homed"


def test_the_hook_turns_little_from_a_place_to_the_next_and_stands_at_the_wall():
    world, joints = World(), []
    while len(joints) < 2:
        world.step()
        if world.state.step is Step.BURN and (len(world.ties) == 10 - len(joints)):
            joints.append(world.joints["PSM1"].copy())
            wall = np.linalg.norm(world.nodes - world.state.place, axis=1).min()
            hook = np.linalg.norm(world.nodes - world.hands["PSM1"].bare_end, axis=1).min()
            assert hook < wall
    assert np.abs(np.delete(joints[1] - joints[0], 2)).max() < 1.0


def test_a_place_out_of_reach_is_left_for_the_next():
    world = World("attempts=1")
    while world.state.step is not Step.PLAN:
        world.step()
    choose, refused = world.routine._hook.choose, []

    def one_is_out_of_reach(place, *rest):
        if not refused:
            refused.append(place)
            raise MotionError("too far")
        return choose(place, *rest)

    world.routine._hook.choose = one_is_out_of_reach
    world.run(1.0)
    assert len(refused) == 1
    assert not world.state.failed
    assert world.state.step in (Step.HOVER, Step.REACH)


@pytest.mark.parametrize(
    ("setting", "why"),
    [
        ("grasper=PSM1", "hook and grasper are two arms"),
        ("hook=PSM3", "PSM3 holds no cautery hook or spatula"),
        ("pull=[1.0, 0.5]", "state the least, then the largest"),
    ],
)
def test_roles_that_do_not_fit_are_refused(setting, why):
    with pytest.raises(ScenarioError, match=why):
        load("gallbladder-bed", [f"participants.routine.{setting}"])


def test_a_saved_routine_goes_on_with_the_same_commands():
    world = World()
    while world.state.step is not Step.BURN:
        world.step()
    again = World()
    again.routine.restore(world.routine.save())
    again.joints, again.held, again.grip = dict(world.joints), world.held, world.grip
    again.jaw, again.t, again.delivered = world.jaw, world.t, world.delivered
    again.heats = world.heats.copy()
    for _ in range(200):
        one, other = world.step(), again.step()
        assert one["PSM1/servo_cp"] == other["PSM1/servo_cp"]
        assert world.powers[-1] == again.powers[-1]
    assert world.routine.state_hash() == again.routine.state_hash()


def test_the_hook_keeps_clear_of_what_lies_in_its_way():
    world = World()
    hook, place, normal = world.routine._hook, np.array([-0.02, 0.03, -0.004]), np.array([0.0, 0.0, 1.0])
    hook.period = 0.01
    hook.stay()
    ahead, nothing = np.array([0.0, 1.0, 0.0]), Obstacles.points(np.zeros((0, 3)), np.zeros(0))
    world.step()
    free = pose_to_matrix(hook.choose(place, ahead, normal, 0.02, nothing))
    shaft = free[:3, 3] - 0.02 * free[:3, 2]
    bar = Obstacles.points(shaft + np.linspace(-0.03, 0.03, 13)[:, None] * normal, np.full(13, 0.004))
    other = pose_to_matrix(hook.choose(place, ahead, normal, 0.02, bar))
    assert np.linalg.norm(other[:3, 2] - free[:3, 2]) > 0.2  # another direction
    for pose in (free, other):
        assert np.allclose(pose[:3, :3] @ hook._middle + pose[:3, 3], place, atol=1e-9)


@pytest.mark.long
def test_fat_is_lifted_without_power_then_burnt_and_the_lower_third_follows():
    world = Triangle("attempts=1")
    world.firm[:] = True
    world.run(120.0)
    assert world.state.done
    assert len(world.fat) <= 2
    assert world.routine.ended == "cystic_plate is free (lower third), after 0 recoveries"
    assert world.said.index("the fat is cleared") < world.said.index("all is free")
    steps = world.steps[: world.steps.index(Step.BURN) + 1]
    assert steps[-3:] == [Step.REACH, Step.RAISE, Step.BURN]
    burns = np.array(world.burns)
    assert (burns[:, 2] > 0.005).all()  # above what lies below the fat
    duct = np.linalg.norm(burns[:, None] - world.common_duct, axis=2).min(axis=1)
    assert (duct > 0.006).all()
    assert np.linalg.norm(burns[0] - [-0.010, -0.006, 0.004]) < 0.012  # begun far from the common duct


def test_weak_fat_comes_off_without_power():
    world = Triangle("attempts=1")
    world.firm[:] = world.weak[:] = True
    while world.state.clears or world.state.step < Step.PLAN:
        world.step()
    assert not world.burns
    assert "the fat is cleared" in world.said


@pytest.mark.long
def test_fat_beside_the_common_duct_is_not_burnt_and_given_up():
    world = Triangle("attempts=1")
    world.firm[:] = True
    world.common_duct += [-0.009, 0.0, 0.012]
    world.run(120.0)
    assert world.state.failure is Failure.NOT_PARTED
    duct = np.linalg.norm(np.array(world.burns)[:, None] - world.common_duct, axis=2).min(axis=1)
    assert (duct > 0.006).all()


def test_fat_is_stripped_by_folds_without_power_before_anything_is_held():
    world = Triangle()
    while Step.LIFT not in world.steps:
        world.step()
    assert len(world.fat) <= 2
    assert 0 < world.folds <= 4
    assert not any(world.powers)
    assert world.steps[1:5] == [Step.HOVER_FOLD, Step.REACH_FOLD, Step.PINCH, Step.STRIP]


def test_the_gallbladder_is_grasped_beside_the_fat():
    world = Triangle()
    world.firm[:] = True
    while not world.state.grasped:
        world.step()
    tip = world.tip("PSM2")
    ends = tip[:3, 3] + 0.012 * tip[:3, 2]
    assert np.linalg.norm(world.sheet - ends, axis=1).min() > 4e-3


def test_fat_that_hangs_loose_below_is_not_what_the_hook_lifts():
    world = Triangle("attempts=1")
    world.firm[:] = True
    world.sheet = np.concatenate([world.sheet, world.sheet - [0.0, 0.0, 0.025]])
    while world.state.step is not Step.RAISE:
        world.step()
    assert world.hands["PSM1"].bare_end[2] > 0.0
