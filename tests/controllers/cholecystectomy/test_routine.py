"""The clip-and-cut routine without physics: to the end, and after everything that goes wrong."""

import numpy as np
import pytest

from controllers.cholecystectomy.places import choose_places
from controllers.cholecystectomy.sub_task import Failure, Step, SubTask
from schemas.errors import ScenarioError
from tests.controllers.cholecystectomy.world import FAR, NECK, World


def lengths(far=FAR):
    return np.linalg.norm(far - NECK, axis=1)


@pytest.mark.long
def test_the_17_sub_tasks_follow_each_other_and_clips_and_cuts_are_where_they_should_be():
    world = World()
    assert world.run() is SubTask.DONE
    assert world.tasks == [SubTask(number) for number in range(1, 19)]
    assert world.state.recoveries == 0
    assert len(world.instructions) == len(set(world.instructions)) == 17
    assert world.instructions[0] == "grasp the gallbladder"
    assert world.instructions[3] == "put the second clip on the cystic duct"
    assert world.instructions[-2:] == ["cut the cystic artery", "go back from the cut in the cystic artery"]
    assert world.routine.ended == "both tubes are clipped and cut, after 0 recoveries"
    for tube, length in enumerate(lengths()):
        first, second, third = world.clips[tube]
        assert first - second > 3.2e-3  # a gap of 2 mm between clips of 1.2 mm
        for clip in (second, third):
            assert 1.6e-3 < abs(clip - world.cuts[tube]) < 3.6e-3  # a cuff of 1 to 3 mm
        assert third < world.cuts[tube] < second
        assert length - first > 5e-3


@pytest.mark.long
def test_a_tube_in_front_of_the_other_is_clipped_and_cut_first():
    world = World(far=[FAR[0], [30e-3, -22e-3, 8e-3]])
    assert world.run() is SubTask.DONE
    assert world.state.second_first
    first, second = (world.said.index(f"{tube} is parted") for tube in ("cystic_artery", "cystic_duct"))
    assert first < second
    assert world.tasks == [SubTask(number) for number in range(1, 19)]


def test_a_long_tube_is_clipped_where_it_is_free_of_the_gallbladder():
    near, free = choose_places(30e-3), choose_places(30e-3, 8e-3)
    assert free.clips[2] == pytest.approx(8e-3)
    assert np.ptp(free.clips) == pytest.approx(np.ptp(near.clips))
    assert choose_places(10e-3, 8e-3).clips[2] == choose_places(10e-3).clips[2]


def test_the_gallbladder_is_pulled_away_from_the_ducts_within_the_limits():
    world = World()
    world.run(lambda world: world.is_at(SubTask.CLIP_1_LEFT) and world.state.step is Step.HOVER)
    assert world.shift[0] < -4e-3
    assert 0.3 <= 60.0 * float(np.linalg.norm(world.shift)) < 1.1


@pytest.mark.long
def test_missed_grasps_are_tried_again_elsewhere_and_deeper():
    world = World()
    world.misses = 2
    assert world.run() is SubTask.DONE
    assert world.state.recoveries == 2
    world = World()
    world.misses = 99
    world.run()
    assert world.state.failure is Failure.GRASP_MISSED
    assert "given up in sub-task 1, grasp gallbladder: grasp missed: nothing is held" in world.routine.ended


@pytest.mark.long
def test_a_grasp_that_slips_is_taken_again_before_the_work_goes_on():
    world = World()
    world.run(lambda world: world.is_at(SubTask.CLIP_2_LEFT))
    world.lose_grasp()
    assert world.run() is SubTask.DONE
    assert world.tasks.count(SubTask.GRASP_GALLBLADDER) == 2
    assert [len(clips) for clips in world.clips] == [3, 3]


def test_a_grasp_that_slips_again_and_again_is_given_up():
    world = World()
    for _ in range(6):
        world.run(lambda world: world.state.grasped)
        world.lose_grasp()
        world.step()
    world.run()
    assert world.state.failure is Failure.GRASP_SLIPPED


@pytest.mark.long
def test_a_clip_that_slips_is_set_beside_its_place_or_given_up():
    world = World()
    world.slips = 1
    assert world.run() is SubTask.DONE
    assert world.state.recoveries == 1
    world = World()
    world.slips = 99
    world.run()
    assert world.state.failure is Failure.CLIP_SLIPPED
    assert "clip 1 left: clip slipped" in world.routine.ended


@pytest.mark.long
def test_a_clip_that_comes_off_later_is_replaced():
    world = World()
    world.run(lambda world: world.is_at(SubTask.BACK_FROM_CLIP_2_LEFT))
    world.pull_off(0, 0)
    assert world.run() is SubTask.DONE
    assert world.tasks.count(SubTask.CLIP_1_LEFT) == 2
    assert len(world.clips[0]) == 3


@pytest.mark.long
def test_a_cut_that_leaves_the_tube_together_is_made_again():
    world = World()
    world.blunt = 2
    assert world.run() is SubTask.DONE
    assert world.state.recoveries == 2
    world = World()
    world.blunt = 99
    world.run()
    assert world.state.failure is Failure.NOT_PARTED


@pytest.mark.long
def test_the_cut_goes_between_the_clips_as_they_lie_and_a_further_clip_makes_room():
    world = World()
    world.astray[0, 1], world.astray[1, 2] = -1.9e-3, 3.2e-3
    assert world.run() is SubTask.DONE
    assert [len(clips) for clips in world.clips] == [3, 4]
    for clips, cut in zip(world.clips, world.cuts, strict=True):
        apart = np.array(clips) - cut
        assert (apart > 1.5e-3).sum() >= 2
        assert (apart < -1.5e-3).any()
        assert (np.abs(apart) > 1.5e-3).all()


@pytest.mark.long
def test_a_stump_that_bleeds_after_the_cut_is_clipped_again():
    world = World()
    world.leaks[0] = 2e-3
    assert world.run() is SubTask.DONE
    assert [len(clips) for clips in world.clips] == [4, 3]
    assert world.clips[0][3] > world.cuts[0] + 1.5e-3


@pytest.mark.long
def test_a_tube_parted_beyond_its_second_clip_gets_another_or_is_given_up_without_room():
    world = World()
    world.run(lambda world: world.cuts[0] is not None)
    world.cuts[0] = float(np.mean(world.clips[0][:2]))
    assert world.run() is SubTask.DONE
    assert [len(clips) for clips in world.clips] == [4, 3]
    assert world.clips[0][3] > world.cuts[0] + 1.5e-3
    world.cuts[0], world.state.done = 24e-3, False
    assert world.run() is SubTask.FAILED
    assert world.state.failure is Failure.OPEN
    assert "stump not closed: cystic_duct has 4 clips, and no room for a further one" in world.routine.ended


@pytest.mark.long
def test_the_gallbladder_is_pulled_elsewhere_where_no_way_leads_past_an_organ():
    world = World("avoid=[wall]")
    world.run(lambda world: world.is_at(SubTask.BACK_FROM_CLIP_3_LEFT))
    world.spared = world.line(0).points_m.reshape(-1, 3)
    world.run(lambda world: world.state.pulls > 0)
    assert "the gallbladder is pulled elsewhere" in world.said[-1]
    before = world.shift.copy()
    world.run(lambda world: world.state.step is not Step.RETRACT)
    across = world.shift - before
    assert np.linalg.norm(across - across @ before / (before @ before) * before) > 4e-3
    world.spared = world.spared + 0.2
    assert world.run() is SubTask.DONE


@pytest.mark.long
def test_scissors_do_not_close_on_an_organ_to_be_spared():
    world = World("avoid=[wall]")
    world.run(lambda world: world.is_at(SubTask.CUT_LEFT) and world.state.step is Step.REACH)
    world.spared = world.line(0).points_m.reshape(-1, 3)
    world.run(lambda world: world.state.recoveries > 0)
    assert world.cuts == [None, None]
    assert "an organ to be spared lies between the blades" in world.said[-1]
    world.spared = world.spared + 0.2
    assert world.run() is SubTask.DONE


@pytest.mark.long
def test_a_tube_that_moves_is_aimed_at_anew():
    world = World()
    world.run(lambda world: world.is_at(SubTask.CLIP_1_LEFT) and world.state.step is Step.HOVER)
    world.sway = np.array([2e-3, -3e-3, 2e-3])
    assert world.run() is SubTask.DONE
    assert world.state.recoveries == 0


def test_a_tube_without_room_is_named():
    far = NECK + (FAR - NECK) * np.array([[0.3], [1.0]])
    world = World(far=far)
    world.run()
    assert world.state.failure is Failure.TOO_SHORT
    assert "a tube of 7.5 mm has no room for three clips and a cut: 8.2 mm at least" in world.routine.ended


@pytest.mark.long
def test_a_tube_out_of_reach_is_named():
    world = World()
    world.run(lambda world: world.is_at(SubTask.BACK_FROM_CUT_LEFT))
    world.sway = np.array([0.0, 0.2, 0.0])
    assert world.run() is SubTask.FAILED
    assert world.state.failure is Failure.OUT_OF_REACH
    assert "PSM1 does not reach cystic_artery" in world.routine.ended


def test_a_refused_command_ends_the_routine_with_its_text():
    world = World()
    world.run(lambda world: world.is_at(SubTask.CLIP_1_LEFT))
    world.refused.append(("PSM1", "servo_cp refused"))
    world.run()
    assert world.state.failure is Failure.REFUSED
    assert world.routine.ended.endswith("command refused: PSM1: servo_cp refused")


@pytest.mark.long
def test_a_saved_routine_goes_on_to_the_bit():
    world, other = World(), World()
    for each in (world, other):
        each.run(lambda world: world.is_at(SubTask.CLIP_2_LEFT))
    saved = world.routine.save()
    other.routine._surgeon.state.values[:] = 0.0
    other.routine.restore(saved)
    for _ in range(500):
        world.step()
        other.step()
    assert world.routine.state_hash() == other.routine.state_hash()


@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ("scissors=PSM1", "three arms"),
        ("pull=[1 N, 0.5 N]", "the least, then the largest"),
    ],
)
def test_parameters_that_make_no_sense_are_refused(setting, reason):
    with pytest.raises(ScenarioError, match=reason):
        World(setting)
