import numpy as np
import pytest

from robots.training.needles import NEEDLES
from robots.training.phantoms import PHANTOMS


@pytest.mark.parametrize("name", PHANTOMS)
def test_holes_are_in_the_skin_and_stitches_go_from_right_to_left(name):
    phantom = PHANTOMS[name]
    assert phantom.names == ("entry1", "entry2", "entry3", "entry4", "exit1", "exit2", "exit3", "exit4")
    holes = phantom.holes
    assert (np.abs(holes[:, :2, 3]) < np.array(phantom.skin[:2]) / 2.0 - 5e-3).all()
    assert np.abs(holes[:, 2, 3]).max() < 1.1e-3
    assert (phantom.entries[:, 0, 3] > phantom.exits[:, 0, 3]).all()
    # out of the tissue, and to the side that the needle comes from and goes to
    assert (holes[:, 2, 2] > 0.0).all()
    assert (phantom.entries[:, 0, 2] > 0.0).all()
    assert (phantom.exits[:, 0, 2] < 0.0).all()


@pytest.mark.parametrize(
    ("name", "bites", "tilt"),
    [
        ("src-3d-med", (12.2, 14.1), 54.2),
        ("src-straight", (9.8, 10.9), 71.7),
        ("src-simple", (7.4, 8.5), 46.1),
    ],
)
def test_the_challenge_s_phantoms_have_its_bites_and_tilts(name, bites, tilt):
    phantom = PHANTOMS[name]
    apart = np.linalg.norm(phantom.exits[:, :3, 3] - phantom.entries[:, :3, 3], axis=1) * 1e3
    assert bites[0] - 0.06 < apart.min()
    assert apart.max() < bites[1] + 0.06
    assert np.degrees(np.arccos(phantom.entries[:, 2, 2])) == pytest.approx(tilt, abs=0.1)


def test_a_needle_of_the_authors_comes_in_as_the_holes_of_their_pad_point():
    phantom, radius = PHANTOMS["branch-top"], NEEDLES["sh-plus"].radius
    bite = phantom.entries[0, 0, 3] - phantom.exits[0, 0, 3]
    centre_height = np.sqrt(radius**2 - (bite / 2.0) ** 2)
    assert phantom.entries[0, :3, 2] @ [bite / 2.0, 0.0, -centre_height] == pytest.approx(0.0, abs=1e-12)
