import numpy as np
import pytest

from robots.dvrk.end_effectors.scissors import CURVE, Scissors
from robots.dvrk.instruments import instrument, instruments
from schemas.errors import MotionError


def test_all_instruments_of_the_controller_are_there_with_probe_hand_roller_and_irrigator():
    assert len(instruments()) == 54 + 4
    assert sum(one.has_snake_wrist for one in instruments().values()) == 3


def test_every_instrument_is_whole():
    for name, one in instruments().items():
        assert one.name == name
        assert np.allclose(one.tip[:3, :3] @ one.tip[:3, :3].T, np.eye(3), atol=1e-15), name
        assert np.linalg.det(one.tip[:3, :3]) == pytest.approx(1.0), name
        assert np.linalg.matrix_rank(one.actuator_to_joint) == 4, name
        assert one.source.startswith("share/tool/"), name
        assert all(joint.lower < 0 < joint.upper and joint.effort > 0 for joint in one.joints), name
        assert one.joints[0].name == "roll", name
        if one.jaw:
            assert one.jaw.lower <= 0 < one.jaw.upper, name
            assert 0.005 < one.jaw.length < 0.04, name


@pytest.mark.parametrize(
    ("number", "shaft", "offset", "jaw"),
    [
        ("400006", 0.4162, 0.0091, (-0.698132, 1.39626, 0.16)),
        ("420006", 0.4670, 0.0091, (-0.349066, 1.39626, 0.16)),
        ("400049", 0.4162, 0.0091, (-0.349066, 1.39626, 0.16)),
        ("420049", 0.4670, 0.0091, (-0.349066, 1.39626, 0.16)),
        ("400093", 0.4162, 0.0107, (-0.349066, 1.39626, 0.16)),
        ("400172", 0.4162, 0.0107, (-0.349066, 1.39626, 0.19)),
        ("400205", 0.4162, 0.0107, (-0.698132, 1.39626, 0.19)),
    ],
)
def test_numbers_of_the_common_instruments(number, shaft, offset, jaw):
    one = instrument(number)
    assert one.number == number
    assert instrument(one.name) is one
    assert (one.joints[0].d, one.joints[2].a) == (shaft, offset)
    assert one.jaw
    assert (one.jaw.lower, one.jaw.upper, one.jaw.effort) == jaw


def test_a_number_means_the_plain_variant():
    assert instrument("420006").name == "LARGE_NEEDLE_DRIVER_420006"
    assert instrument("LARGE_NEEDLE_DRIVER_420006_GEARED").number == "420006"


@pytest.mark.parametrize("name", ["palpation-probe", "400183", "400184"])
def test_what_does_not_open_has_no_jaw(name):
    assert instrument(name).jaw is None


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("40006", "420006"),
        ("PROGRASP_400093", "PROGRASP_FORCEPS_400093"),
        ("palpation_probe", "palpation-probe"),
    ],
)
def test_an_unknown_instrument_is_refused_with_what_is_near(word, meant):
    with pytest.raises(MotionError, match=f"no instrument '{word}'. Did you mean '{meant}'"):
        instrument(word)


def test_a_hook_touches_from_heel_to_tip_and_a_spatula_along_its_end():
    hook, spatula = (
        [sphere for sphere in instrument(number).spheres if sphere.name.startswith("electrode")]
        for number in ("400183", "400184")
    )
    places = np.array([sphere.position for sphere in hook])
    assert np.ptp(places[:, 2]) == pytest.approx(0.003 - 2 * hook[0].radius)
    assert np.ptp(places[:, :2], axis=0) == pytest.approx([0, 0], abs=1e-12)
    along = np.array([sphere.position for sphere in spatula])
    assert np.ptp(along[:, 2]) == pytest.approx(0.0, abs=1e-12)
    for spheres in (hook, spatula):
        ends = [np.linalg.norm(np.array(sphere.position)[:2]) + sphere.radius for sphere in spheres]
        assert max(ends) == pytest.approx(0.0155)


@pytest.mark.parametrize("number", ["400183", "400184"])
def test_the_stem_of_an_electrode_touches_without_gaps_from_its_bare_end_to_the_wrist(number):
    spheres = instrument(number).spheres
    ahead = [float(np.linalg.norm(sphere.position[:2])) for sphere in spheres]
    stem = [way for way, sphere in zip(ahead, spheres, strict=True) if sphere.name.startswith("stem")]
    radius = spheres[-1].radius
    assert np.diff(stem) == pytest.approx(-2.0 * radius)
    assert 0.0 <= stem[-1] < 2.0 * radius
    bare = min(way for way, sphere in zip(ahead, spheres, strict=True) if "electrode" in sphere.name)
    assert bare - stem[0] == pytest.approx(radius + spheres[0].radius, abs=2e-4)


@pytest.mark.parametrize(
    ("number", "energy"),
    [
        ("400183", "monopolar"),
        ("420184", "monopolar"),
        ("400179", "monopolar"),
        ("400172", "bipolar"),
        ("420205", "bipolar"),
        ("400178", None),
        ("400049", None),
    ],
)
def test_energy_instruments_are_known_by_their_names(number, energy):
    assert instrument(number).energy == energy


@pytest.mark.parametrize(
    ("number", "least", "most"), [("400003", 2e-3, 4e-3), ("420327", 3.5e-3, 7e-3), ("400230", 5e-3, 13e-3)]
)
def test_clip_appliers_are_known_by_their_names(number, least, most):
    clip = instrument(number).clip
    assert clip.diameters == (least, most)
    assert clip.length > most
    assert instrument("400006").clip is None


@pytest.mark.parametrize("name", [name for name in instruments() if "SCISSORS" in name])
def test_the_edges_of_scissors_meet_in_the_closed_jaw(name):
    tool = instrument(name)
    scissors, spheres = tool.end_effector, tool.spheres
    assert isinstance(scissors, Scissors)
    half_turn = np.diag([1.0, -1.0, -1.0])  # frame of the right finger, in the closed jaw
    left, right = ([np.array(spheres[i].position) for i in edge] for edge in scissors.edges)
    for one, other in zip(left, right, strict=True):
        np.testing.assert_allclose(one, half_turn @ other, atol=1e-12)
    assert np.linalg.norm(left[1][:2]) == pytest.approx(scissors.length)
    assert left[1][2] == (CURVE if "CURVED" in name else 0.0)
    assert spheres[scissors.hinge].position[:2] == (0.0, 0.0)
    assert spheres[scissors.hinge].position[2] > 0.0
