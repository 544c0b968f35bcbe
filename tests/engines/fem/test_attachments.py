"""Two organs that hang together: forces, work of separation, cuts, burns, and the same bits."""

import numpy as np
import pytest

from engines.fem.attachments.carried import carried_pieces
from engines.fem.engine import FemEngine
from engines.fem.params import FemParams
from hub.participant import Inputs
from hub.testing import check_engine
from schemas.errors import ScenarioError
from tests.engines.fem.rig import MS, FemRig

BED = {"size": ["24 mm", "20 mm", "8 mm"], "young_modulus": "20 kPa", "nodes": 300}
FLAP = {
    "size": ["12 mm", "10 mm", "4 mm"],
    "position": ["1 mm", "0.7 mm", "4.3 mm"],
    "young_modulus": "20 kPa",
    "nodes": 150,
    "anchors": [],
}
AREA, STRENGTH, TOUGHNESS = 120e-6, 2e3, 4.0
PLATE = {"organs": ["flap", "bed"], "within": "0.6 mm", "strength": STRENGTH, "toughness": TOUGHNESS}
UP, ASLANT = np.array([0.0, 0.0, 0.06e-3]), np.array([0.1e-3, 0.0, 0.1e-3])


def given(plate=PLATE, probe=None, **changes):
    organs = {"bed": BED | changes.pop("bed", {}), "flap": FLAP | changes.pop("flap", {})}
    return FemParams.model_validate(
        {"organs": organs, "attachments": {"plate": plate}, "probes": {"probe": probe or {}}} | changes
    )


class PlateRig(FemRig):
    """A flap on a bed, and an instrument."""

    def __init__(self, probe=None, start=(0.0, 0.0, 0.05), **changes):
        super().__init__(given(probe=probe, **changes), start)
        self.watts, self.said = np.zeros(1), []
        self.inputs = Inputs(
            {f"probe/{name}": self.pose for name in ("pose", "position")}
            | {f"probe/{name}": self.twist for name in ("twist", "velocity")}
            | {"probe/energy": self.watts}
        )

    def follow(self, motion, seconds):
        for k in range(round(seconds * 1e9 / self.period)):
            super().follow(lambda t, begun=k * self.period * 1e-9: motion(begun + t), self.period * 1e-9)
            self.said += self.outputs["flap/events"]
        return self.wrenches

    @property
    def flap(self):
        return self.engine._organs[1]

    @property
    def ties(self):
        return self.engine._attachments

    @property
    def freed(self):
        return float(self.outputs["plate/freed"][0])

    @property
    def pulled(self):
        """Force on the flap, N."""
        return self.outputs["plate/force"]

    def take(self):
        """Let sphere 0 hold the top of the flap."""
        top = self.flap.mesh.nodes[:, 2] > self.flap.mesh.nodes[:, 2].max() - 1e-6
        for node in np.flatnonzero(top).tolist():
            self.flap.anchor(node, 0)


def test_the_tied_area_is_that_of_the_surfaces_which_face_each_other():
    with PlateRig() as rig:
        assert rig.ties._area.sum() == pytest.approx(AREA, rel=1e-6)
        assert rig.freed == 0.0


def test_an_attached_organ_hangs_by_its_weight():
    hanging = {"orientation": [1.0, 0.0, 0.0, 0.0]}
    below = {"position": ["1 mm", "0.7 mm", "-0.3 mm"]}
    bed = hanging | {"anchors": [{"surface": "bottom"}]}
    with PlateRig(bed=bed, flap=below) as rig:
        weight = float(rig.flap.solid.mass.sum()) * 9.80665
        rig.hold(0.2)
        assert rig.pulled[2] == pytest.approx(weight, rel=0.03)
        assert rig.freed == 0.0


def test_a_pulled_organ_comes_off_at_the_strength_and_with_the_work_of_the_attachment():
    with PlateRig(gravity=0.0) as rig:
        rig.take()
        felt = []
        for _ in range(100):
            rig.move(rig.at + UP, 0.008)
            felt.append(rig.pulled[2])
        assert rig.freed == pytest.approx(AREA, rel=1e-6)
        assert -min(felt) == pytest.approx(STRENGTH * AREA, rel=0.1)
        assert sum(rig.power) * 1e-3 == pytest.approx(TOUGHNESS * AREA, rel=0.05)
        assert {(one.kind, one.instrument) for one in rig.said} == {("detached", "probe")}


def test_a_light_pull_opens_nothing_and_is_borne():
    with PlateRig(gravity=0.0) as rig:
        rig.take()
        rig.move(rig.at + ASLANT, 0.1)
        rig.hold(0.2)
        assert rig.freed == 0.0
        assert rig.ties.widest.max() < 0.3e-3
        assert rig.pulled[2] < -0.02
        rig.move(rig.at - ASLANT, 0.1)
        rig.hold(0.2)
        assert abs(rig.pulled[2]) < 0.005


def test_a_flap_that_has_come_off_lies_on_the_bed_again():
    with PlateRig() as rig:
        rig.ties.widest[:] = np.inf
        rig.hold(0.5)
        gap = rig.flap.nodes[:, 2].min() - 0.0
        assert -0.2e-3 < gap < 0.2e-3
        assert rig.freed == pytest.approx(AREA, rel=1e-6)


def test_an_organ_that_hangs_on_a_held_one_is_carried_far_and_falls_once_it_is_off():
    cutting = {"cutting": {}}
    with PlateRig(gravity=0.0, bed=cutting | {"anchors": []}, flap=cutting) as rig:
        rig.take()
        rig.move(rig.at + 600 * UP, 0.72)
        bed = rig.engine._organs[0]
        assert bed.solid.displacement[:, 2].min() > bed.reach
        assert (bed.solid.pieces >= 0).all()
        assert rig.freed == 0.0
        rig.ties.widest[:] = np.inf
        rig.hold(0.05)
        assert (bed.solid.pieces < 0).all()


def test_a_chain_of_organs_is_carried_by_its_only_anchor():
    with PlateRig(bed={"cutting": {}}, flap={"cutting": {}}) as rig:
        bed, flap = rig.engine._organs
        chain, none = np.array([[1, 0, 0, 0]]), np.zeros((0, 4), np.int64)
        assert [list(one) for one in carried_pieces([bed, flap], chain)] == [[0], [0]]
        assert [list(one) for one in carried_pieces([bed, flap], none)] == [[0], []]
        assert [list(one) for one in carried_pieces([flap, bed, flap], chain)] == [[0], [0], []]


def test_a_blade_between_the_organs_cuts_the_ties_that_it_passes():
    blade = {"spheres": 2, "radius": "0.5 mm", "blades": [[0, 1]]}
    start = np.array([[-12e-3, -9e-3, 0.15e-3], [-12e-3, 10e-3, 0.15e-3]])
    cutting = {"cutting": {}}
    with PlateRig(blade, start, gravity=0.0, bed=cutting, flap=cutting) as rig:
        rig.move(start + np.array([13e-3, 0.0, 0.0]), 0.2)
        rig.hold(0.6)
        assert rig.freed == pytest.approx(AREA / 2, rel=0.25)
        assert ("detached", "probe") in {(one.kind, one.instrument) for one in rig.said}


def test_heat_parts_the_ties_around_it():
    hook = {"radius": "1 mm", "energy": {"power": "40 W", "efficiency": 1.0}}
    with PlateRig(hook, (-5.5e-3, 0.7e-3, 0.5e-3), gravity=0.0) as rig:
        rig.watts[:] = 40.0
        rig.hold(1.0)
        assert 0.0 < rig.freed < AREA / 2
        parted = np.isinf(rig.ties.widest)
        places = rig.flap.mesh.nodes[rig.flap.solid.tetrahedra[rig.ties._element, rig.ties._corner]]
        assert places[parted][:, 0].max() < places[~parted][:, 0].max()


def test_saved_in_the_middle_of_parting_it_goes_on_with_the_same_bits():
    def go(rig):
        for _ in range(10):
            rig.move(rig.at + UP, 0.008)

    with PlateRig(gravity=0.0) as rig:
        rig.take()
        for _ in range(4):
            go(rig)
        assert rig.ties.widest.max() > 0.0
        saved, at, t = rig.engine.save(), rig.at.copy(), rig.t
        go(rig)
        after = rig.hashes[-1]
        rig.engine.restore(saved)
        rig.at[:], rig.t = at, t
        go(rig)
        assert rig.hashes[-1] == after


@pytest.mark.parametrize("is_tied", [True, False])
@pytest.mark.parametrize("way", [(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)])
def test_jaws_that_hold_both_sides_of_a_gap_do_not_throw_the_third_node_of_a_face_away(way, is_tied):
    apart = np.array([[0.0, 0.0, 0.05], [0.0, 0.0, 0.06]])
    with PlateRig(gravity=0.0, probe={"spheres": 2, "radius": "2 mm"}, start=apart) as rig:
        bed, shares = rig.engine._organs[0], np.abs(rig.ties.rest[:, :3])
        tie = int(shares.min(axis=1).argmin())
        _, corner, _, slot = rig.ties.place[tie]
        rig.flap.anchor(int(rig.flap.solid.tetrahedra[corner // 4, corner % 4]), 1)
        for node in np.delete(bed.solid.faces[slot], shares[tie].argmin()).tolist():
            bed.anchor(node, 0)
        if not is_tied:
            rig.ties.restore(np.full(len(shares), np.inf))
        rig.move(apart + np.array([np.array(way) * 1e-3, np.zeros(3)]), 0.05)
        fastest = [np.abs(organ.solid.velocity[:, :3]).max() for organ in rig.engine._organs]
        assert max(fastest) < 0.2


def test_attachments_keep_the_contract_of_engines():
    inputs = {"probe/pose": [0, 0, 0.01, 0, 0, 0, 1], "probe/twist": [0.0, 0, -0.02, 0, 0, 0]}
    check_engine(lambda: FemEngine("tissue", given()), period_ns=4 * MS, inputs=inputs)


@pytest.mark.parametrize(
    ("plate", "problem"),
    [
        ({"organs": ["flap", "bad"]}, "there is no organ 'bad'. Did you mean 'bed'"),
        ({"organs": ["bed", "bed"]}, "'bed' cannot be attached to itself"),
        ({"strength": 0.0}, "greater than 0"),
    ],
)
def test_attachments_that_cannot_be_are_refused(plate, problem):
    with pytest.raises(ValueError, match=problem):
        given(PLATE | plate)


def test_organs_that_are_far_apart_cannot_be_attached():
    with pytest.raises(ScenarioError, match="attachment 'plate': no face of 'flap' that looks at 'bed' is"):
        PlateRig(flap={"position": ["1 mm", "0.7 mm", "14.3 mm"]})


def test_an_output_says_where_organs_still_hang_together():
    plate = PLATE | {"lower_end": ["-5 mm", 0.0, 0.0], "opened": 0.5}
    with PlateRig(plate=plate) as rig:
        rig.hold(0.02)
        ties = rig.outputs["plate/ties"]
        points = ties.points_m.reshape(-1, 3)
        assert ties.areas_m2.sum() == pytest.approx(float(rig.outputs["plate/tied"][0]), rel=1e-9)
        assert len(points) == len(ties.areas_m2) == int((~np.isinf(rig.ties.widest)).sum())
        assert points[:, 0].min() > -0.002  # the half of the flap that is not opened
        nodes, bed = rig.flap.nodes, rig.engine._organs[0].nodes
        assert bed[:, 2].max() < points[:, 2].mean() < nodes[:, 2].min() + 0.3e-3
        rig.ties.widest[:] = np.inf
        rig.hold(0.02)
        assert not rig.outputs["plate/ties"].points_m.size


def test_attachments_need_contact_of_organs():
    with pytest.raises(ValueError, match="leave organ_contact on"):
        given(organ_contact=False)


def test_the_lower_third_may_be_open_from_the_beginning():
    plate = PLATE | {"lower_end": ["-5 mm", 0.0, 0.0]}
    with PlateRig(plate=plate | {"opened": 0.5}) as rig, PlateRig(plate=plate) as whole:
        rig.hold(0.02)
        assert rig.freed == pytest.approx(0.5 * AREA, rel=0.1)
        assert rig.freed + float(rig.outputs["plate/tied"][0]) == pytest.approx(AREA, rel=1e-6)
        assert rig.outputs["plate/lower_third"][0] == 1.0
        assert not rig.said
        whole.hold(0.02)
        assert whole.outputs["plate/lower_third"][0] == 0.0
        at = whole.flap.mesh.nodes[:, 0]
        number = whole.ties._lower["plate"]
        nodes = whole.flap.solid.tetrahedra[whole.ties._element, whole.ties._corner][number]
        assert at[nodes].max() < np.median(at)
    with pytest.raises(ValueError, match="state lower_end"):
        given(PLATE | {"opened": 0.5})
