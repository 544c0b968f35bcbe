"""The middle line of a tube: place, width, clips and partings."""

from math import pi

import numpy as np
import pytest

from engines.fem.blood.partings import find_partings, without_crumbs
from schemas.codec import decode, encode
from schemas.trocar_msgs import TubeLine
from tests.engines.fem.blood.test_lumen import TubeRig, foreign_tube


def points(line):
    return line.points_m.reshape(-1, 3)


def test_the_line_of_a_resting_tube_is_its_axis_from_left_to_right():
    with TubeRig() as rig:
        line = rig.outputs["block/line"]
        axis = np.linspace([-20e-3, 0.0, 0.0], [20e-3, 0.0, 0.0], len(line.along_m))
        assert np.abs(points(line) - axis).max() < 1e-6
        assert line.along_m == pytest.approx(np.linspace(0.0, 40e-3, len(line.along_m)), abs=1e-6)
        assert line.areas_m2 == pytest.approx(np.full(len(line.along_m), pi * 1.5e-3**2), rel=0.05)
        assert line.diameters_m == pytest.approx(np.full(len(line.along_m), 5e-3))
        assert not line.shut.any()
        assert not line.parted.any()
        again = decode(TubeLine, encode(line))
        assert np.array_equal(again.points_m, line.points_m)
        assert np.array_equal(again.areas_m2, line.areas_m2)


def test_a_clip_shuts_the_rings_under_it():
    with TubeRig() as rig:
        rig.clip(5e-3)
        line = rig.outputs["block/line"]
        at = np.flatnonzero(line.shut)
        assert np.abs(points(line)[at, 0] - 5e-3).max() < 1.5e-3
        assert np.array_equal(line.areas_m2 == 0.0, line.shut > 0)


def test_a_parted_tube_says_where():
    with TubeRig() as rig:
        rig.open(3e-3, above=0.0)
        rig.hold(0.016)
        assert not rig.outputs["block/line"].parted.any()
        rig.open(3e-3)
        rig.open(-8e-3)
        rig.hold(0.016)
        line = rig.outputs["block/line"]
        found = line.along_m[np.flatnonzero(line.parted)]
        assert found == pytest.approx([12e-3, 23e-3], abs=2.5e-3)


def test_an_imported_tube_has_a_line_too(tmp_path):
    with TubeRig(**foreign_tube(tmp_path)) as rig:
        rig.open(0.0)
        rig.hold(0.016)
        line = rig.outputs["block/line"]
        assert np.diff(points(line)[:, 0]).min() > 0.0
        assert np.abs(points(line)[:, 1:]).max() < 0.5e-3
        assert line.along_m[np.flatnonzero(line.parted)] == pytest.approx([20e-3], abs=3e-3)


def test_a_slit_along_the_tube_and_a_slanting_gap_with_crumbs():
    along = np.linspace(0.0, 9e-3, 10)
    slit = np.zeros((10, 6), np.int64)
    slit[:, 3:] = 1
    assert find_partings(slit, along) == []
    slanting = np.zeros((10, 6), np.int64)
    for sector, ring in enumerate((4, 4, 5, 5, 6, 6)):
        slanting[ring, sector], slanting[ring + 1 :, sector] = 7, 2
    (parting,) = find_partings(slanting, along)
    assert parting.along == pytest.approx(4.5e-3)
    assert parting.ring == 4
    assert find_partings(np.full((10, 6), -1), along) == []


def test_crumbs_of_a_cut_are_no_part_of_a_ring():
    pieces = np.zeros((10, 6), np.int64)
    pieces[5:] = 2
    pieces[4, :2] = 7  # a crumb
    pieces[5, 3] = -1  # burnt
    kept = without_crumbs(pieces)
    assert not kept[4, :2].any()
    assert not kept[5, 3]
    assert kept.sum() == 60 - 3


def test_a_crumb_that_flies_off_does_not_move_the_line():
    with TubeRig() as rig:
        solid, ring = rig.organ.solid, 5
        node = rig.lumen._rings[ring, 0]
        touching = (solid.origin[solid.tetrahedra] == node).any(axis=1)
        crumbs = (solid._across >= 0) & touching[:, None]
        solid.compiled.open(np.flatnonzero(crumbs.ravel()).astype(np.int32))
        rig.organ._note_change()
        rig.hold(0.016)
        before, areas = rig.lumen.middles, rig.lumen.open_areas
        rig.organ.nodes = rig.organ.nodes.copy()
        rig.organ.nodes[node] += 50e-3
        assert np.array_equal(rig.lumen.middles, before)
        assert np.array_equal(rig.lumen.open_areas, areas)
        assert np.abs(before[ring, 1:]).max() < 1.5e-3
