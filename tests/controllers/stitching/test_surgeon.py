"""The stitching expert in a world without physics: a shut jaw holds the needle if it is at the wire."""

import re

import numpy as np
import pytest

from controllers.stitching.controller import Stitching
from controllers.stitching.params import StitchingParams
from controllers.stitching.phase import StitchPhase
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from robots import rotation
from robots.dvrk.inverse import inverse
from robots.training.needles import NEEDLES
from robots.transform import inverse_transform, matrix_to_pose, pose_to_matrix
from schemas.errors import SessionError
from schemas.ros import StringMessage

PERIOD = 10_000_000


class World:
    """Two hands and the needle of the scenario; `drop` lets it fall out of all jaws."""

    def __init__(self, **params):
        file = load("suturing", [])
        given = file.params["lead"]
        self.lead = self.make(given, params)
        self.lead.configure(Setup(PERIOD, "."))
        thing = file.params["robot"].objects["needle"]
        self.needle = pose_to_matrix(np.array([*thing.position, *thing.orientation]))
        self.tips = {
            hand.arm: hand.base @ hand.chain.forward(np.array(given.arms.present_arms[hand.arm].start))
            for hand in self.lead._hands
        }
        self.joints = {
            hand.arm: np.array(given.arms.present_arms[hand.arm].start, float) for hand in self.lead._hands
        }
        self.jaws, self.grips, self.t, self.said = dict.fromkeys(self.tips, 0.5), {}, 0, []
        self.fastest = 0.0
        """Most that a joint has moved in a period, rad or m."""
        self.wire = NEEDLES["sh-plus"].points(np.linspace(-1.57, 1.57, 200))

    def make(self, given, params):
        return Stitching("lead", StitchingParams.model_validate(given.model_dump() | params))

    @property
    def phase(self):
        return self.lead._surgeon.state.phase

    def values(self):
        values = {}
        for hand in self.lead._hands:
            arm = hand.arm
            values[f"{arm}/local/measured_cp"] = matrix_to_pose(inverse_transform(hand.base) @ self.tips[arm])
            values[f"{arm}/measured_js"] = np.concatenate([self.joints[arm], np.zeros(12)])
            wide = 0.1 if arm in self.grips and self.jaws[arm] < 0 else self.jaws[arm]
            values[f"{arm}/jaw/measured_js"] = np.array([wide, 0, 0])
        values["objects/needle/pose"] = matrix_to_pose(self.needle)
        holders = sorted(float(arm[-1]) for arm in self.grips)
        values["objects/needle/held_by"] = np.array([holders[0] if holders else 0.0])
        return values

    def step(self, **events):
        out = self.lead.step(self.t, PERIOD, Inputs(self.values(), events=events))
        self.t += PERIOD
        self.said += [message.data for message in out["status"]]
        for hand in self.lead._hands:
            self._follow(hand, out)
        return out

    def _follow(self, hand, out):
        arm = hand.arm
        for message in out[f"{arm}/jaw/move_jp"]:
            self.jaws[arm] = float(message.position[0])
            self.grips.pop(arm, None)
            at = self.tips[arm][:3, 3] + 9.2e-3 * self.tips[arm][:3, 2]
            places = self.wire @ self.needle[:3, :3].T + self.needle[:3, 3]
            if self.jaws[arm] < 0 and np.linalg.norm(places - at, axis=1).min() < 0.5e-3:
                self.grips[arm] = inverse_transform(self.tips[arm]) @ self.needle
        for message in out[f"{arm}/servo_cp"]:
            p, q = message.pose.position, message.pose.orientation
            tip = pose_to_matrix(np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w]))
            self.tips[arm] = hand.base @ tip
            joints = inverse(hand.chain, tip, self.joints[arm])
            self.fastest = max(self.fastest, float(np.abs(joints - self.joints[arm]).max()))
            self.joints[arm] = joints
        if arm in self.grips and len(self.grips) == 1:
            self.needle = self.tips[arm] @ self.grips[arm]

    def run(self, seconds, until=lambda world: world.lead.ended):
        for _ in range(round(seconds * 1e9 / PERIOD)):
            self.step()
            if until(self):
                break
        return self


@pytest.mark.long
def test_two_stitches_are_made_through_their_holes_one_after_the_other():
    world, tips = World(stitches=2), []
    while not world.lead.ended and world.t < 90e9:
        world.step()
        if world.phase in (StitchPhase.DRIVE, StitchPhase.PULL):
            tips.append(world.needle[:3, :3] @ NEEDLES["sh-plus"].marks[2] + world.needle[:3, 3])
    assert world.lead.ended == "all stitches are made"
    assert world.said[0].startswith("2 stitches are feasible")
    holes = world.lead.params.phantom.measures
    for hole in (*holes.entries[:2], *holes.exits[:2]):
        assert np.linalg.norm(np.array(tips) - hole[:3, 3], axis=1).min() < 0.2e-3
    assert list(world.grips) == ["PSM2"]


def drop(world, arm):
    """Open a jaw from outside."""
    world.jaws[arm] = 0.7
    world.grips.pop(arm, None)


@pytest.mark.parametrize(
    ("phase", "seconds", "arm"), [("DRIVE", 2.0, "PSM1"), ("COME", 0.3, "PSM1"), ("PULL", 1.0, "PSM2")]
)
def test_a_needle_that_is_dropped_in_the_tissue_is_said_to_be_there_and_taken_again(phase, seconds, arm):
    world = World(stitches=1).run(60, until=lambda w: w.phase.name == phase)
    world.run(seconds, until=lambda _: False)
    drop(world, arm)
    world.run(60)
    assert world.lead.ended == "all stitches are made", world.said
    assert f"{arm} has lost the needle while it was to {phase.lower()}: its middle is at" in world.said[-1]
    assert world.said[-1].endswith("it is taken again")
    assert world.lead._surgeon.state.made[0] == 1.0
    assert list(world.grips) == ["PSM2"]


def test_a_needle_that_has_turned_in_the_jaw_is_handed_over_and_taken_anew():
    world = World(stitches=1).run(60, until=lambda w: w.phase is StitchPhase.APPROACH)
    turn, contact = np.eye(4), np.eye(4)
    turn[:3, :3] = rotation.matrix(rotation.exp(np.array([0.0, np.radians(40.0), 0.0])))
    contact[2, 3] = 9.2e-3
    world.grips["PSM1"] = contact @ turn @ inverse_transform(contact) @ world.grips["PSM1"]
    world.run(90)
    assert world.lead.ended == "all stitches are made", world.said
    (said,) = [each for each in world.said if "has turned in the jaw" in each]
    assert re.search(r"of PSM1, whose \w+ would be .* degrees, allowed .*; it is taken again", said)
    assert world.lead._surgeon.state.made[0] == 1.0


def test_a_needle_that_nobody_can_take_ends_it_with_where_it_is_and_why():
    world = World(stitches=1).run(60, until=lambda w: w.phase is StitchPhase.APPROACH)
    drop(world, "PSM1")
    world.needle[:3, 3] = 0.4, 0.0, 0.0
    world.run(2)
    assert world.lead.ended == f"a stitch has failed: {world.said[-1]}"
    assert re.search(r"lost the needle .* at 400, 0, 0 mm, .*; it cannot go on: .*PSM1", world.said[-1])


def test_a_needle_under_the_skin_but_beside_the_pad_is_not_said_to_be_in_the_tissue():
    world = World(stitches=1).run(60, until=lambda w: w.phase is StitchPhase.APPROACH)
    drop(world, "PSM1")
    world.needle[:3, 3] = 0.12, 0.0, -0.03
    world.run(2)
    assert world.said[-1].endswith("at 120, 0, -30 mm, its tip outside; it is taken again")


@pytest.mark.long
def test_a_needle_that_is_always_dropped_is_given_up():
    world = World(stitches=1)
    for _ in range(4):
        world.run(60, until=lambda w: w.phase is StitchPhase.DRIVE and w.needle[2, 3] < 0.01)
        drop(world, "PSM1")
        world.run(1, until=lambda w: w.phase is not StitchPhase.DRIVE)
    assert world.lead.ended == f"a stitch has failed: {world.said[-1]}"


def test_a_needle_that_is_always_dropped_in_the_tissue_is_given_up_after_three_recoveries():
    world = World(stitches=1)
    for _ in range(4):
        world.run(60, until=lambda w: w.phase is StitchPhase.PULL).run(0.3, until=lambda _: False)
        drop(world, "PSM2")
        world.run(1, until=lambda w: w.phase is not StitchPhase.PULL)
    assert world.lead.ended == f"a stitch has failed: {world.said[-1]}"
    assert re.search(r"^PSM2 has lost .* to pull: .*; given up after 3 recoveries$", world.said[-1])
    assert [each.endswith("it is taken again") for each in world.said[-4:]] == [True, True, True, False]


def test_a_needle_out_of_reach_is_refused_before_anything_moves():
    world = World(stitches=1)
    world.needle[:3, 3] += [0.4, 0.0, 0.0]
    world.run(1)
    assert world.lead.ended == f"a stitch has failed: {world.said[-1]}"
    assert "the needle cannot be picked up: of PSM1" in world.said[-1]


def test_a_saved_expert_goes_on_with_the_same_bits():
    world, other = World(stitches=1), World(stitches=1)
    world.run(6)
    other.lead.restore(world.lead.save())
    for each in ("jaws", "tips", "grips"):
        setattr(other, each, dict(getattr(world, each)))
    other.needle, other.t = world.needle, world.t
    world.run(1), other.run(1)
    assert world.lead.state_hash() == other.lead.state_hash()


def test_a_refused_command_ends_the_session_and_says_what_was_done():
    with pytest.raises(SessionError, match="PSM2 in phase 'begin': too far"):
        World().step(**{"PSM2/error": (StringMessage(data="too far"),)})


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"driver": "PSM3"}, "PSM3 is no arm of the scene"),
        ({"driver": "PSM2"}, "driver and puller are both PSM2"),
        ({"first": 3}, "stitches 3 to 6: the phantom has 4 pairs"),
        ({"fixtures": {}}, "the scene has 0 phantoms"),
        ({"objects": {}}, "the scene has 0 needles"),
    ],
)
def test_what_makes_no_sense_is_refused(wrong, problem):
    with pytest.raises(ValueError, match=problem):
        World(**wrong)
