"""A stitch that a person guides, in the world without physics of the stitching expert's tests."""

import re

import numpy as np
import pytest

from controllers.motion.frames import base_in_world
from controllers.motion.params import MotionParams
from controllers.stitching.guided_controller import GuidedStitching, GuidedStitchingParams
from controllers.stitching.phase import StitchPhase
from controllers.stitching.stage import Stage
from hub.planning.scenario_file import load
from robots import rotation
from robots.dvrk.endoscope import EYES, StereoCamera, left_camera
from robots.training.needles import NEEDLES
from robots.transform import inverse_transform, matrix_to_pose
from schemas.ros import BoolMessage, Header, Point, PointStamped, StringMessage
from schemas.visualization import MarkerAction
from tests.controllers.stitching.test_surgeon import World, drop

TIP_PERIOD = 1.2e-3
"""m; the way of a tip at its largest speed, 0.12 m/s, in a period."""


class Guided(World):
    """The world of the expert; its controllers are ideal, so that a setpoint is where the tip is."""

    def make(self, given, params):
        given = load("suturing-by-hand", []).params["lead"]
        ecm = given.arms.ECM
        self.camera = matrix_to_pose(ecm.chain.forward(np.array(ecm.start)))
        return GuidedStitching("lead", GuidedStitchingParams.model_validate(given.model_dump() | params))

    def __init__(self, **params):
        self.markers, self.led, self.largest = {}, False, 0.0
        super().__init__(**params)
        self.step()

    @property
    def stage(self):
        return self.lead._surgeon.guided.stage

    def values(self):
        values = super().values()
        for hand in self.lead._hands:
            values[f"{hand.arm}/local/setpoint_cp"] = values[f"{hand.arm}/local/measured_cp"]
        values["ECM/local/measured_cp"] = self.camera
        return values

    def step(self, **events):
        before = {arm: tip[:3, 3].copy() for arm, tip in self.tips.items()}
        if self.led:
            events["PSM1/following"] = (BoolMessage(data=True),)
        out = super().step(**events)
        for arm, place in before.items():
            self.largest = max(self.largest, float(np.linalg.norm(self.tips[arm][:3, 3] - place)))
        for array in out["markers"]:
            for marker in array.markers:
                if marker.action == MarkerAction.DELETE:
                    self.markers.pop(marker.ns, None)
                else:
                    self.markers[marker.ns] = marker
        return out

    def pick(self, x, y, frame="phantom", z=0.0):
        point = PointStamped(header=Header(frame_id=frame), point=Point(x=x, y=y, z=z))
        self.step(pick=(point,))
        return self

    def say(self, word):
        self.step(command=(StringMessage(data=word),))
        return self

    @property
    def proposal(self):
        """The name of the proposal that was shown last."""
        return [found[1] for text in self.said if (found := re.search(r"consent (\w{8})\?", text))][-1]

    def consent(self):
        return self.say(f"consent {self.proposal}")

    def consented(self):
        return self.pick(0.008, 0.018).pick(-0.008, 0.018).consent()

    def until(self, phase, seconds=30):
        return self.run(seconds, until=lambda world: world.phase.name == phase)


@pytest.mark.long
def test_a_person_picks_sees_the_path_consents_and_gets_a_stitch_through_both_points():
    world = Guided()
    world.pick(0.008, 0.018)
    assert {"stitch/entry", "stitch/banner"} <= set(world.markers)
    world.pick(-0.008, 0.018)
    tips = dict(world.tips)
    assert world.stage is Stage.PROPOSED
    assert {"stitch/entry", "stitch/exit", "stitch/path", "stitch/disc"} <= set(world.markers)
    assert f"consent {world.proposal}?" in " ".join(world.markers["stitch/banner"].text.split())
    world.run(1.0, until=lambda _: False)
    assert all((world.tips[arm] == tip).all() for arm, tip in tips.items())  # nothing moves before consent
    world.consent().run(60, until=lambda w: w.stage is Stage.PICKING)
    assert list(world.grips) == ["PSM2"]
    assert world.lead._surgeon.state.made[0] == 1.0
    assert "stitch/path" not in world.markers
    world.pick(0.008, 0.006).pick(-0.008, 0.006).consent().until("COME_BACK")  # from the other hand
    assert world.largest < TIP_PERIOD


@pytest.mark.parametrize(
    ("degrees", "way", "ends_with"),
    [
        pytest.param(180, [], "PSM2", id="to the left: as a right hand makes it"),
        pytest.param(0, ["PSM2"], "PSM1", id="to the right: a left hand is given the needle, and drives it"),
        pytest.param(-135, [], "PSM1", id="out of reach of the left hand: the right one also pulls"),
        pytest.param(-45, ["PSM2"], "PSM2", id="out of reach of the right hand: it gives the needle away"),
    ],
)
def test_a_stitch_goes_in_any_direction(degrees, way, ends_with):
    world, tips, takers = Guided(), [], []
    holes = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0.0]) * 0.008
    entry, leave = np.array([0.0, 0.01, 0.0]) - holes, np.array([0.0, 0.01, 0.0]) + holes
    world.pick(*entry[:2]).pick(*leave[:2]).consent()
    while world.stage is Stage.RUNNING and world.t < 60e9:
        world.step()
        if world.phase is StitchPhase.APPROACH and takers != (held := list(world.grips)):
            takers = held
        if world.phase in (StitchPhase.DRIVE, StitchPhase.PULL):
            tips.append(world.needle[:3, :3] @ NEEDLES["sh-plus"].marks[2] + world.needle[:3, 3])
    assert world.lead._surgeon.state.made[0] == 1.0, world.said
    assert takers == (way or ["PSM1"])
    assert list(world.grips) == [ends_with]
    for hole in (entry, leave):
        assert np.linalg.norm(np.array(tips) - hole, axis=1).min() < 0.2e-3
    assert world.largest < TIP_PERIOD


def test_words_about_points_of_one_step_come_in_the_order_of_the_points():
    world = Guided()
    point = PointStamped(header=Header(frame_id="phantom"), point=Point(x=0.008, y=0.018, z=0.0))
    before = len(world.said)
    world.step(pick=(point, point))
    picked, refused = world.said[before:]
    assert picked == "the entry is picked, the exit is next"
    assert refused.startswith("refused: entry and exit are 0.0 mm apart")


@pytest.mark.long
def test_a_needle_that_lies_the_wrong_way_up_is_turned_over_by_the_other_hand():
    world = Guided()
    world.needle = world.needle @ np.diag([1.0, -1.0, -1.0, 1.0])
    world.step()
    assert world.consented().stage is Stage.RUNNING, world.said
    world.until("PULL", 60)
    assert world.phase is StitchPhase.PULL, world.said


@pytest.mark.long
@pytest.mark.parametrize(
    "phases",
    [("LIFT", "PRESENT", "TAKE_BACK", "LEAVE_BACK", "LET_GO"), ("STEP_BACK", "TAKE", "PULL")],
    ids=["until the driving jaw lets go", "until the needle is out"],
)
def test_a_stitch_with_exchanged_hands_goes_on_after_a_take_over_in_each_phase(phases):
    world = Guided()  # PSM1 gives the needle to PSM2, which drives, lets go and pulls
    world.pick(-0.0057, 0.0157).pick(0.0057, 0.0043).consent()
    for phase in phases:
        assert world.until(phase).phase.name == phase, world.said
        world.led = True
        world.step()
        world.led = False
        world.step(**{"PSM1/following": (BoolMessage(data=False),)})
        world.say("resume")
        assert world.stage is Stage.RUNNING, world.said
    world.run(60, until=lambda w: w.stage is not Stage.RUNNING)
    assert world.lead._surgeon.state.made[0] == 1.0, world.said
    assert list(world.grips) == ["PSM2"]
    assert world.largest < TIP_PERIOD


def test_points_may_be_in_any_frame():
    world = Guided()
    entry = np.array([0.008, 0.018, 0.0, 1.0])
    for frame, pose in (
        ("PSM1_base", world.lead._hands[0].base),
        ("PSM1", world.tips["PSM1"]),
        ("needle", world.needle),
    ):
        x, y, z = (inverse_transform(pose) @ entry)[:3].tolist()
        world.pick(x, y, frame, z)
        assert world.lead._surgeon.guided.points[0] == pytest.approx(entry[:3])
        world.say("cancel")
    world.pick(0, 0, "endoscope_left_optical", 0.05)
    assert "above the skin" in world.said[-1]
    world.pick(0, 0, "PSM7")
    assert "frame_id 'PSM7' is no frame of this scene" in world.said[-1]


@pytest.mark.parametrize("eye", EYES)
def test_a_pixel_of_a_picture_is_the_point_of_the_pad_under_it(eye):
    world, camera = Guided(), StereoCamera()
    params, entry = world.lead.params, np.array([0.008, 0.018, 0.0])
    ecm = params.arms.ECM
    stands = base_in_world("ECM", MotionParams(arms=params.arms))
    left = stands @ left_camera(ecm.endoscope, camera.baseline).forward(np.array(ecm.start))
    there = inverse_transform(left) @ params.phantom.pose @ [*entry, 1.0]
    x, y, ahead = camera.projection(eye) @ there
    world.pick(x / ahead, y / ahead, f"endoscope_{eye}_image")
    assert world.lead._surgeon.guided.points[0] == pytest.approx(entry, abs=1e-9)
    world.pick(camera.width, 0, f"endoscope_{eye}_image")
    assert "is not in a picture of 320 x 288 pixels" in world.said[-1]


def test_a_pixel_beside_the_pad_is_refused():
    world = Guided()
    back = rotation.product(world.camera[3:], np.array([1.0, 0.0, 0.0, 0.0]))
    world.camera = np.concatenate([world.camera[:3], back])
    world.pick(160, 144, "endoscope_left_image")
    assert "does not look at the pad" in world.said[-1]


@pytest.mark.parametrize(
    ("entry", "leave", "why"),
    [
        ((0.081, 0.0), (0.070, 0.0), r"entry is 1\.0 mm beside the pad"),
        ((0.012, 0.0), (-0.012, 0.0), r"24\.0 mm apart, and the needle is 22\.9 mm across"),
        ((0.008, 0.0), (0.007, 0.0), r"1\.0 mm apart, at least 2"),
        ((0.065, 0.037), (0.065, 0.053), r"of PSM[12], .* would .*"),
    ],
)
def test_what_is_not_feasible_is_refused_with_the_number_that_fails(entry, leave, why):
    world = Guided().pick(*entry).pick(*leave)
    assert re.search(why, world.said[-1]), world.said
    assert world.stage is Stage.PICKING
    assert "stitch/path" not in world.markers
    world.say("consent")
    assert "refused: 'consent' while picking, allowed: cancel" in world.said[-1]


@pytest.mark.parametrize("phase", ["HOVER", "DRIVE"])
def test_it_pauses_and_resumes_in_any_phase_without_a_step(phase):
    world = Guided().consented().until(phase)
    world.run(0.3, until=lambda _: False)
    world.say("pause").run(0.5, until=lambda _: False)
    tips = {arm: tip.copy() for arm, tip in world.tips.items()}
    out = world.step()
    assert not out["PSM1/servo_cp"]
    world.run(1.0, until=lambda _: False)
    assert all((world.tips[arm] == tip).all() for arm, tip in tips.items())
    world.say("resume").until("DRIVE" if phase != "DRIVE" else "COME")
    assert world.stage is Stage.RUNNING, world.said
    assert world.phase.name != phase
    assert world.largest < TIP_PERIOD


@pytest.mark.parametrize("phase", ["LIFT", "DRIVE"])
def test_a_hand_takes_over_at_any_moment_and_the_stitch_is_planned_from_there(phase):
    world = Guided().consented().until(phase)
    world.run(0.3, until=lambda _: False)
    world.led = True
    out = world.step()
    assert world.stage is Stage.TAKEN_OVER
    assert not out["PSM1/servo_cp"]
    assert not out["PSM2/servo_cp"]
    world.say("resume")
    assert "while a hand leads an arm" in world.said[-1]
    if phase == "LIFT":  # the person moves an arm, and with it the needle
        for _ in range(20):
            world.tips["PSM1"][:3, 3] += [1e-4, 2e-4, 5e-4]
            if "PSM1" in world.grips:
                world.needle = world.tips["PSM1"] @ world.grips["PSM1"]
            world.step()
    world.led = False
    world.step(**{"PSM1/following": (BoolMessage(data=False),)})
    world.say("resume").until("DRIVE" if phase != "DRIVE" else "COME")
    assert world.stage is Stage.RUNNING, world.said
    assert world.phase.name != phase
    assert world.largest < TIP_PERIOD


def test_it_says_why_it_cannot_go_on():
    world = Guided().consented().until("DRIVE")
    world.run(2.0, until=lambda _: False)
    world.say("take over")
    world.tips["PSM1"][:3, 3] += [0.0, 0.003, 0.0]
    world.needle = world.tips["PSM1"] @ world.grips["PSM1"]
    world.say("resume")
    assert "in the tissue and 3.0 mm beside its way, allowed are 2" in world.said[-1]
    assert world.stage is Stage.TAKEN_OVER


def test_a_needle_dropped_in_the_tissue_stops_it_until_a_person_lets_it_go_on():
    world = Guided().consented().until("DRIVE")
    world.run(2.0, until=lambda _: False)
    drop(world, "PSM1")
    world.run(1.0, until=lambda w: w.stage is Stage.STOPPED)
    assert "stopped: PSM1 has lost the needle" in world.said[-1]
    tips = {arm: tip.copy() for arm, tip in world.tips.items()}
    world.run(1.0, until=lambda _: False)
    assert all((world.tips[arm] == tip).all() for arm, tip in tips.items())
    world.say("resume").run(60, until=lambda w: w.stage is Stage.PICKING)
    assert world.lead._surgeon.state.made[0] == 1.0, world.said
    assert list(world.grips) == ["PSM2"]
    assert world.largest < TIP_PERIOD


def test_a_saved_stitch_goes_on_with_the_same_bits():
    world, other = Guided(), Guided()
    world.consented().run(4, until=lambda _: False)
    other.lead.restore(world.lead.save())
    other.tips = {arm: tip.copy() for arm, tip in world.tips.items()}
    other.jaws, other.grips = dict(world.jaws), dict(world.grips)
    other.joints = dict(world.joints)
    other.needle, other.t = world.needle.copy(), world.t
    assert other.phase is world.phase is not StitchPhase.DONE
    world.run(1, until=lambda _: False)
    other.run(1, until=lambda _: False)
    assert world.lead.state_hash() == other.lead.state_hash()


def test_of_a_stitch_that_is_not_feasible_it_says_which_turn_makes_it_so():
    world = Guided().pick(0.065, 0.037).pick(0.065, 0.053)
    assert "refused: the stitch is not feasible" in world.said[-1]
    turn = 90 + int(world.said[-1].split("turned by ")[1].split(" degrees")[0])
    c, s = 0.008 * np.cos(np.radians(turn)), 0.008 * np.sin(np.radians(turn))
    world.pick(0.065 - c, 0.045 - s).pick(0.065 + c, 0.045 + s)
    assert "consent " in world.said[-1]


def test_a_consent_is_to_the_proposal_that_it_names():
    """A is proposed, and replaced by B before the consent to A arrives: nothing moves."""
    world = Guided().pick(0.008, 0.018).pick(-0.008, 0.018)
    first = world.proposal
    world.pick(0.008, 0.006).pick(-0.008, 0.006)
    second, tips = world.proposal, {arm: tip.copy() for arm, tip in world.tips.items()}
    assert first != second
    world.say(f"consent {first}").run(0.5, until=lambda _: False)
    refusal, question = world.said[-2:]
    assert refusal == f"refused: a consent to '{first}', but '{second}' is proposed"
    assert question.startswith(f"consent {second}? PSM1 drives")
    world.say("consent")
    assert world.said[-2] == f"refused: a consent to '', but '{second}' is proposed"
    assert world.stage is Stage.PROPOSED
    assert all((world.tips[arm] == tip).all() for arm, tip in tips.items())
    assert f"consent {second}?" in " ".join(world.markers["stitch/banner"].text.split())
    world.pick(0.008, 0.018).pick(-0.008, 0.018)
    assert world.proposal == first, "the name is that of the proposal, not of the moment"
    assert world.consent().stage is Stage.RUNNING


def test_words_that_are_none_are_refused():
    world = Guided().say("go")
    assert "'go' is no command, allowed: consent, pause, resume" in world.said[-1]


@pytest.mark.parametrize("name", ["stitches", "first", "end"])
def test_what_only_the_expert_obeys_is_no_parameter(name):
    with pytest.raises(ValueError, match=name):
        Guided(**{name: 1})
