"""The scenarios of servoing and tracking with the real renderer, for as long as it takes to see them work."""

import numpy as np
import pytest

import trocar
from controllers.swaying_phantom import SwayingPhantom, SwayingPhantomParams
from hub.participant import Inputs, Setup
from hub.recording.report_vision import vision_figures
from hub.testing import check_engine

pytestmark = [
    pytest.mark.xdist_group("vision"),
    pytest.mark.usefixtures("opengl"),
]


@pytest.fixture(scope="module")
def servoed(tmp_path_factory):
    record = tmp_path_factory.mktemp("servoing") / "session"
    trocar.run(
        "visual-servoing", set={"duration": "1.2 s", "scene.looks": False}, one_host=True, record=record
    )
    return trocar.Recording(record)


def test_servoing_comes_nearer_with_every_picture(servoed):
    error = servoed["servoing.feature_error"].values[:, 0]
    seen = error[error > 0.0]
    assert seen[0] > 50.0
    assert seen[-1] < 15.0
    assert (np.diff(seen[5:]) < 0.0).all()


def test_a_session_that_pictures_steer_is_re_simulated_bit_for_bit(servoed):
    assert trocar.verify(servoed.file.parent).same


def test_the_report_has_its_figures(servoed):
    titles = [figure.title for figure in vision_figures(servoed)]
    assert titles == [
        "servoing: camera, velocity",
        "servoing: camera, angular velocity",
        "servoing: features",
        "servoing: feature error",
    ]


@pytest.mark.long
def test_the_needle_is_found_and_followed(tmp_path):
    record = tmp_path / "session"
    summary = trocar.run("needle-tracking", set={"duration": "1 s"}, one_host=True, record=record)
    recording = trocar.Recording(record)
    error = recording["check.pose_error"].values[-10:]
    assert 1e3 * np.linalg.norm(error[:, :3], axis=1).max() < 0.7
    assert np.degrees(np.linalg.norm(error[:, 3:], axis=1)).max() < 2.5
    assert recording["check.nees"].values[-10:, 0].max() < 22.5  # 99.9 % of 6 degrees of freedom
    assert summary
    titles = [figure.title for figure in vision_figures(recording)]
    assert titles == ["check: position", "check: rotation"]


def test_the_phantom_sways_as_the_authors_does():
    phantom = SwayingPhantom("phantom", SwayingPhantomParams(position=(0.0, 0.0, 0.1)))
    start = phantom.configure(Setup(5_000_000, "."))["nodes"]
    assert start.triangles.size == 36
    middles = [start.nodes_m.reshape(-1, 3).mean(axis=0)]
    for step in range(197):
        state = phantom.step(step * 5_000_000, 5_000_000, Inputs({}))["nodes"]
        assert state.triangles.size == 0
        middles.append(state.nodes_m.reshape(-1, 3).mean(axis=0))
    assert np.allclose(middles[0], middles[-1], atol=1e-7)
    assert np.allclose(np.ptp(middles, axis=0), [4e-3, 4e-3, 10e-3], rtol=1e-2)
    check_engine(lambda: SwayingPhantom("phantom", phantom.params), period_ns=5_000_000)
