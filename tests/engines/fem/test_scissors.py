"""Scissors: they cut while they close, open blades press, and instruments of the dVRK bring their edges."""

from math import cos, radians, sin

import numpy as np
import pytest

from engines.bullet.params import BulletParams
from engines.fem.edges import Edges, Scissors, closing_rates
from tests.engines.fem.rig import FemRig, params

STRIP = {
    "size": ["24 mm", "10 mm", "4 mm"],
    "nodes": 500,
    "young_modulus": "100 kPa",
    "anchors": [{"surface": "left"}, {"surface": "right"}],
    "cutting": {"toughness": "200 J/m^2"},
}
SCISSORS = {"left": [0, 1], "right": [2, 3], "hinge": 4}
PROBE = {"spheres": 5, "radius": "0.8 mm", "scissors": SCISSORS}
ROOT, END = 3e-3, 15.5e-3
OPEN = radians(75.0)
BESIDE = np.array([1e-3, -9e-3, -2e-3])


def spheres(angle, hinge=BESIDE):
    """Edges across the strip that open up and down, beside it: roots and ends, shape (5, 3)."""
    ways = [
        np.array([0.0, way * cos(angle / 2.0), side * way * sin(angle / 2.0)])
        for side in (1.0, -1.0)
        for way in (ROOT, END)
    ]
    return hinge + np.array([*ways, [2e-3, 0.0, 0.0]])


def rig_of(angle=OPEN, hinge=BESIDE):
    return FemRig(params(STRIP, PROBE), spheres(angle, hinge))


def turn(rig, start, end, seconds, hinge=BESIDE):
    """Turn the blades from one angle to another."""
    rate = (end - start) / seconds

    def motion(t):
        angle = start + rate * t
        ahead = (spheres(angle + 1e-6, hinge) - spheres(angle - 1e-6, hinge)) / 2e-6
        return spheres(angle, hinge), rate * ahead

    return rig.follow(motion, seconds)


def test_closing_blades_cut_through_what_is_between_them():
    with rig_of() as rig:
        turn(rig, OPEN, radians(-10.0), 0.3)
        turn(rig, radians(-10.0), OPEN, 0.2)
        organ = rig.engine._organs[0]
        assert len(np.unique(organ.solid.pieces[organ.solid.pieces >= 0])) >= 2
        assert np.abs(organ.solid.displacement[:, :3]).max() < 2e-3, "open blades let go of both sides"
        area = 10e-3 * 4e-3
        assert rig.outputs["block/cut_area"][0] == pytest.approx(area, rel=0.25)
        assert rig.outputs["block/cut_work"][0] == pytest.approx(200.0 * rig.outputs["block/cut_area"][0])
        assert np.isfinite(rig.nodes).all()


def test_open_blades_that_press_do_not_cut():
    above = BESIDE + np.array([0.0, 0.0, 9e-3])
    with rig_of(radians(60.0), above) as rig:
        rig.move(spheres(radians(60.0), above) - np.array([0.0, 0.0, 6e-3]), 0.3)
        assert np.abs(rig.force.sum(axis=0)[2]) > 0.3
        assert rig.outputs["block/cut_area"][0] == 0.0
        assert len(rig.outputs["block/surface"].slots) == 0


def test_opening_blades_leave_the_tissue():
    inside = BESIDE + np.array([0.0, 4e-3, 0.0])
    with rig_of(0.0, inside) as rig:
        turn(rig, 0.0, radians(40.0), 0.3, inside)
        assert rig.outputs["block/cut_area"][0] == 0.0
        assert np.abs(rig.force[:4]).max() == 0.0


@pytest.mark.long
def test_wild_scissors_leave_no_nan():
    random = np.random.default_rng(1)
    with rig_of() as rig:
        angle, hinge = OPEN, BESIDE
        for seconds in (0.01, 0.05, 0.2, 0.01, 0.1, 0.05):
            angles = angle, random.uniform(-0.3, 1.4)
            hinges = hinge, BESIDE + random.uniform([-8e-3, -6e-3, -5e-3], [8e-3, 8e-3, 5e-3])

            def place(t, angles=angles, hinges=hinges, seconds=seconds):
                share = t / seconds
                return spheres(*(a + (b - a) * share for a, b in (angles, hinges)))

            rig.follow(lambda t, at=place: (at(t), (at(t + 1e-6) - at(t - 1e-6)) / 2e-6), seconds)
            angle, hinge = angles[1], hinges[1]
        assert np.isfinite(rig.nodes).all()
        assert np.isfinite(rig.wrenches).all()
        assert rig.outputs["block/cut_area"][0] > 1e-5


def test_the_side_of_the_hinge_says_where_closing_goes():
    ends, scissors = [(0, 1), (2, 3)], [Scissors(0, 1, 4)]
    edges = Edges(ends, 40, 200.0, scissors)
    for start, end, sharp in ((0.2, 0.1, True), (0.1, 0.2, False), (0.0, -0.1, True), (-0.1, 0.0, False)):
        edges.sharpen(closing_rates(scissors, ends, spheres(start), spheres(end), 1.0))
        assert edges.toughness.tolist() == [200.0 if sharp else -1.0] * 2
    edges.sharpen(closing_rates(scissors, ends, spheres(0.2), spheres(0.2 - 1e-3), 1.0))
    assert np.isinf(edges.toughness).all(), "a held jaw trembles"


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"hinge": 3}, "at no blade's end"),
        ({"hinge": 5}, "at no blade's end"),
        ({"left": [0, 9]}, "from 0 to 4"),
    ],
)
def test_scissors_of_other_spheres_are_refused(change, problem):
    with pytest.raises(ValueError, match=problem):
        params(STRIP, PROBE | {"scissors": SCISSORS | change})


def test_in_bullet_scissors_press():
    soft = {key: value for key, value in STRIP.items() if key != "cutting"}
    assert BulletParams.model_validate({"organs": {"block": soft}, "probes": {"probe": PROBE}})
