"""What is said of clips and partings of tubes: which tube, where along the line, by which instrument."""

import numpy as np
import pytest

from engines.fem.params import FemParams
from hub.participant import Inputs
from schemas.ros import EmptyMessage
from tests.engines.fem.blood.test_lumen import FAR, TUBE, TubeRig
from tests.engines.fem.rig import FemRig


def said(rig):
    return rig.outputs["block/tube"]


class PairRig(FemRig):
    """Two tubes along x, one above the other, and a block of other tissue beside."""

    def __init__(self, diameters=("2 mm", "7 mm"), tissue_at="60 mm"):
        tube = TUBE | {"tube": {"length": "40 mm", "diameter": "3 mm", "wall": "0.6 mm"}}
        organs = {
            "duct": tube | {"position": [0.0, 0.0, "2 mm"]},
            "artery": tube | {"position": [0.0, 0.0, "-2 mm"]},
            "fat": {
                "size": ["8 mm", "8 mm", "3 mm"],
                "young_modulus": "5 kPa",
                "position": [0.0, tissue_at, "1 mm"],
            },
        }
        probe = {"spheres": 2, "radius": "1 mm", "clip": {"diameters": list(diameters)}}
        given = {"organs": organs, "probes": {"probe": probe}, "gravity": 0.0, "organ_contact": False}
        super().__init__(FemParams.model_validate(given), FAR)
        self.commands = {}
        pose = {"probe/position": self.pose, "probe/velocity": self.twist}
        self.inputs = Inputs(pose, events=self.commands)

    def clip(self, low, high):
        """Close a clip between two heights at x = 0; return the events of both tubes."""
        self.at[:] = [[0.0, 0.0, low], [0.0, 0.0, high]]
        self.hold(0.001)
        self.commands["probe/clip"] = (EmptyMessage(),)
        self.hold(0.001)
        found = self.outputs["duct/tube"], self.outputs["artery/tube"]
        self.commands.clear()
        self.at[:] = FAR
        self.hold(0.02)
        return found


def test_a_clip_says_where_along_the_tube_it_sits_and_who_closed_it():
    with TubeRig() as rig:
        assert rig.outputs["block/tube"] == ()
        for number, x in enumerate((-6e-3, 6e-3)):
            rig.at[:] = [[x, 0.0, -3e-3], [x, 0.0, 3e-3]]
            rig.hold(0.002)
            rig.commands["probe/clip"] = (EmptyMessage(),)
            rig.hold(0.001)
            rig.commands.clear()
            (event,) = said(rig)
            assert (event.kind, event.body, event.instrument, event.clip) == (
                "clipped",
                "block",
                "probe",
                number,
            )
            assert event.along_m == pytest.approx(20e-3 + x, abs=1.0e-3)
            rig.hold(0.001)
            assert said(rig) == ()
        rig.at[:] = FAR
        rig.hold(0.05)
        clips = rig.outputs["block/clips"]
        assert clips.numbers.tolist() == [0, 1]
        assert clips.along_m == pytest.approx([14e-3, 26e-3], abs=1e-3)
        assert clips.on.tolist() == [1, 1]
        assert clips.instruments == ["probe", "probe"]


def test_a_tube_parted_between_clips_says_so_once():
    with TubeRig() as rig:
        for x in (-9e-3, -5e-3, 6e-3):
            rig.clip(x)
        found = []
        rig.open(1e-3)
        rig.organ.events.add("cut", np.ones(1), np.zeros((1, 3)), np.zeros(1, np.int64))
        for _ in range(30):
            rig.hold(0.001)
            found += said(rig)
        (event,) = found
        assert (event.kind, event.instrument, event.cause) == ("parted", "probe", "cut")
        assert (event.left_clips, event.right_clips) == (2, 1)
        assert event.along_m == pytest.approx(21e-3, abs=1.6e-3)
        assert event.position.x == pytest.approx(1e-3, abs=2e-3)


def test_a_restored_tube_does_not_say_its_partings_again():
    with TubeRig() as rig, TubeRig() as other:
        rig.clip(-6e-3)
        rig.open(0.0)
        rig.hold(0.02)
        other.engine.restore(rig.engine.save())
        other.t, other.at[...] = rig.t, rig.at
        for _ in range(20):
            other.hold(0.001)
            assert said(other) == ()
        assert other.outputs["block/clips"].numbers.tolist() == [0]
        assert other.outputs["block/line"].parted.any()


def test_a_clip_that_was_pulled_off_stays_known():
    with TubeRig({"hold_across": "0.05 N"}) as rig:
        rig.clip(0.0)
        clips = rig.engine._blood.bleedings[0].clips
        for node in np.unique(rig.organ.solid.ties[clips._clip_of == 0]).tolist():
            rig.organ.anchor(node, 1)
        found = []
        for _ in range(700):
            rig.move(rig.at + np.array([0.0, 0.0125e-3, 0.0]), 0.001)
            found += said(rig)
            if found:
                break
        assert (found[0].kind, found[0].clip, found[0].instrument) == ("clip pulled off", 0, "probe")
        rig.hold(0.02)
        assert rig.outputs["block/clips"].on.tolist() == [0]
        rig.organ.solid.holder[:] = -1
        rig.clip(8e-3)
        assert rig.outputs["block/clips"].numbers.tolist() == [0, 1]


def test_a_clip_across_two_tubes_shuts_both_and_says_so():
    with PairRig() as rig:
        duct, artery = rig.clip(-5e-3, 5e-3)
        assert [one.kind for one in (*duct, *artery)] == ["clipped", "clipped"]
        assert duct[0].others == ["artery"]
        assert artery[0].others == ["duct"]
        assert rig.outputs["duct/line"].shut.any()
        assert rig.outputs["artery/line"].shut.any()


def test_a_clip_on_one_of_two_tubes_leaves_the_other():
    with PairRig() as rig:
        duct, artery = rig.clip(0.2e-3, 4e-3)
        assert [one.kind for one in duct] == ["clipped"]
        assert duct[0].others == []
        assert artery == ()
        assert not rig.outputs["artery/line"].shut.any()


def test_two_tubes_that_are_too_much_for_a_clip_are_left():
    with PairRig(("2 mm", "4 mm")) as rig:
        duct, artery = rig.clip(-5e-3, 5e-3)
        assert [one.kind for one in (*duct, *artery)] == ["clip slipped", "clip slipped"]
        assert "is too much for a clip" in duct[0].cause
        assert not rig.outputs["duct/line"].shut.any()


def test_a_clip_slips_off_a_tube_with_other_tissue():
    with PairRig(tissue_at="0 mm") as rig:
        duct, _ = rig.clip(-1.5e-3, 4e-3)
        assert duct[0].kind == "clip slipped"
        assert duct[0].others == ["artery", "fat"]
        assert "'fat' is between the jaws too" in duct[0].cause
        assert not rig.outputs["duct/line"].shut.any()
