"""Joint errors that are learnt from where a tip is seen, with the noise of the endoscope's pictures."""

import numpy as np
import pytest

from controllers.stitching.controller import Stitching
from controllers.tip_tracker import TipTracker
from hub.participant import Inputs, Setup
from hub.planning.scenario_file import load
from robots.dvrk.inverse import inverse
from robots.transform import inverse_transform
from schemas.errors import SessionError

PERIOD = 40_000_000
ECM = np.array([0.0, 0.0, 0.125, 0.0, *np.zeros(8)])
OFF = np.array([0.06, -0.05, 4e-3, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def scene():
    return load("suturing", [])


def tracker(scene, **params):
    made = TipTracker("eyes", scene.params["eyes"].model_copy(update=params))
    made.configure(Setup(PERIOD, "."))
    return made


def look(eyes, t, tip):
    """Where PSM1's true tip, shape (3,), in its base frame is seen; PSM2's is behind the cameras."""
    there = np.array([*tip, 0, 0, 0, 1.0])
    away = np.array([0.0, 0.5, 0.5, 0, 0, 0, 1.0])
    values = {"PSM1/measured_cp": there, "PSM2/measured_cp": away, "ECM/measured_js": ECM}
    out = eyes.step(t, PERIOD, Inputs(values))
    assert out["PSM2/seen"] == ()
    return out["PSM1/seen"]


def test_a_resting_tip_is_known_after_some_pictures_and_the_arm_stands_where_it_is_seen(scene):
    sight = Stitching("lead", scene.params["lead"])._sights[0]
    hand, eyes = Stitching("lead", scene.params["lead"])._hands[0], tracker(scene)
    over = hand.base @ hand.chain.forward(np.array([-0.14, 0.14, 0.11, 0, 0, 0]))
    over[:3, 3] = 0.0, 0.0, 0.03
    true = inverse(hand.chain, inverse_transform(hand.base) @ over, np.array([-0.14, 0.14, 0.11, 0, 0, 0]))
    tip = hand.chain.forward(true)
    pictures = 0
    while not sight.is_known:
        pictures += 1
        seen = look(eyes, pictures * PERIOD, tip[:3, 3])
        stands = sight.observe_tip(true - OFF, seen, PERIOD * 1e-9)
    assert 2 < pictures < 100
    found = stands @ hand.chain.forward(true - OFF)
    assert np.linalg.norm(found[:3, 3] - over[:3, 3]) < 4 * 0.3e-3
    assert np.abs(found[:3, :3] - over[:3, :3]).max() < 0.01  # 0.09 without
    before = sight.state.error.copy()
    sight.observe_tip(true - OFF + 0.01, look(eyes, 0, tip[:3, 3] + 0.05), PERIOD * 1e-9)
    assert (sight.state.error == before).all()  # of a tip on its way nothing is learnt


def test_noise_is_that_of_its_covariance_and_the_same_at_every_look(scene):
    eyes = tracker(scene)
    base = eyes._bases["PSM1"]
    tip = base[:3, :3].T @ (np.array([0.0, 0.0, 0.03]) - base[:3, 3])
    places, spread = [], None
    for t in range(400):
        (seen,) = look(eyes, t, tip)
        place = seen.pose.pose.position
        places.append([place.x, place.y, place.z])
        spread = seen.pose.covariance.reshape(6, 6)[:3, :3]
    assert str(look(eyes, 399, tip)) == str((seen,))
    off = np.array(places) - [0.0, 0.0, 0.03]
    squared = np.einsum("ni,ij,nj->n", off, np.linalg.inv(spread), off)
    assert squared.mean() == pytest.approx(3.0, abs=0.5)  # chi squared of 3 degrees of freedom


def test_one_hand_alone_is_not_tracked(scene):
    lead = Stitching("lead", scene.params["lead"])
    with pytest.raises(SessionError, match="only PSM1/seen is connected"):
        lead.configure(Setup(PERIOD, ".", connected=frozenset({"PSM1/seen"})))
