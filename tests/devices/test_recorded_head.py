"""The head that the scenarios play: its velocity is that of its poses, and the endoscope can follow all of
it.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from devices.scripted.device import ScriptedDevice, ScriptedParams
from hub.planning.scenario_file import installed_scenarios
from robots import rotation
from robots.dvrk import ecm


@pytest.fixture(scope="module")
def head():
    params = ScriptedParams.model_validate(
        {"samples": "data/head"}, context={"directory": installed_scenarios()["cart"].parent}
    )
    with ScriptedDevice("head", params) as device:
        device.open(Path())
        return device.read(25 * 10**9)


def _poses(head):
    for message in (sample.message for sample in head if sample.port == "pose"):
        p, q = message.pose.position, message.pose.orientation
        yield message.header.stamp.ns * 1e-9, np.array([p.x, p.y, p.z]), np.array([q.x, q.y, q.z, q.w])


def _twists(head):
    for twist in (sample.message.twist for sample in head if sample.port == "twist"):
        yield (
            np.array([twist.linear.x, twist.linear.y, twist.linear.z]),
            np.array([twist.angular.x, twist.angular.y, twist.angular.z]),
        )


def test_the_twist_is_the_rate_of_the_pose(head):
    twists = pairwise(_twists(head))
    for (t0, p0, q0), (t1, p1, q1) in pairwise(_poses(head)):
        (v0, w0), (v1, w1) = next(twists)
        dt = t1 - t0
        assert np.allclose((p1 - p0) / dt, (v0 + v1) / 2, atol=1e-4)
        assert np.allclose(
            rotation.log(rotation.product(q1, rotation.conjugate(q0))) / dt, (w0 + w1) / 2, atol=1e-3
        )


def test_the_endoscope_can_follow_and_comes_back(head):
    v, w = (np.array(part) for part in zip(*_twists(head), strict=True))
    turn, insertion = ecm.JOINTS[0].velocity, ecm.JOINTS[2].velocity
    assert np.linalg.norm(w, axis=1).max() < turn
    assert np.abs(v[:, 0]).max() < insertion
    _, *_, last = _poses(head)
    assert np.allclose(last[1], 0.0, atol=1e-12)
    assert np.allclose(last[2], [0, 0, 0, 1], atol=1e-12)
    assert [sample.message.data for sample in head if sample.port == "mode"] == ["orientation", "position"]
