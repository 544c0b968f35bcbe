"""The compiled functions against the Python code beside them: every bit, and every refusal."""

import copy
import pickle

import numpy as np
import pytest

from robots import inverse_kinematics, rotation, serial_chain
from robots.dvrk import arms, inverse
from robots.tips import Tips, tip_poses
from schemas.errors import MotionError

pytestmark = pytest.mark.skipif(serial_chain.compiled is None, reason="built without a compiler")

CASES = [("PSM1", "400006"), ("PSM2", "420006"), ("ECM", "up"), ("PSM1", "MUSHA_HAND")]
COUNT = 400


@pytest.fixture
def both(monkeypatch):
    """Return what a function returns, or how it refuses: compiled, and in Python."""

    def outcome(function, *args):
        try:
            return function(*args).tobytes()
        except MotionError as error:
            return str(error)

    def each(function, *args):
        found = outcome(function, *args)
        with monkeypatch.context() as patch:
            for module in (serial_chain, inverse_kinematics, inverse):
                patch.setattr(module, "compiled", None)
            return found, outcome(function, *args)

    return each


@pytest.mark.parametrize(("arm", "tool"), CASES)
def test_a_pose_is_pursued_to_the_same_bits(both, arm, tool):
    chain, random, taken = arms.chain(arm, tool), np.random.default_rng(1), 0
    for i in range(COUNT):
        q = random.uniform(chain.lower, chain.upper)
        away = random.normal(0.0, 10.0 ** random.uniform(-6.0, -0.5), len(q))  # some leave the ranges
        tip = chain.frames(q + away)[-1]
        goal = tip[:3, 3] + (i % 3 == 0) * random.normal(0.0, 0.01, 3)
        most = chain.velocity * 10.0 ** random.uniform(-4.0, -1.0)
        found, expected = both(inverse_kinematics.pursue, chain, q, goal, rotation.from_matrix(tip), most)
        assert found == expected
        assert len(set(both(chain.frames, q))) == 1
        length = inverse_kinematics._LENGTH if len(q) >= 6 else inverse_kinematics._LITTLE
        args = chain.numbers, q, goal, rotation.from_matrix(tip), most, length, 1e-12, 1e-30, 4
        taken += serial_chain.compiled.pursue(*args) is not None
    assert taken > COUNT / 2


@pytest.mark.parametrize(("arm", "tool"), CASES)
def test_the_closed_form_has_the_same_bits_and_refusals(both, arm, tool):
    chain, random, taken = arms.chain(arm, tool), np.random.default_rng(2), 0
    span = chain.upper - chain.lower
    for i in range(COUNT):
        q = chain.lower + span * (random.random(len(span)) * 1.1 - 0.05)  # some are out of reach
        if i % 7 == 0:
            q[random.integers(len(q))] = 0.0  # some are singular
        pose = chain.frames(q)[-1]
        if i % 5 == 0:
            pose[:3, :3] += random.normal(0.0, 10.0 ** random.uniform(-9.0, -4.0), (3, 3))
        near = random.uniform(chain.lower, chain.upper)
        assert len(set(both(inverse.inverse, chain, pose, near))) == 1
        numbers = inverse._form(chain).numbers
        taken += serial_chain.compiled.inverse(chain.numbers, numbers, pose, near) is not None
    assert taken > COUNT / 4


@pytest.mark.parametrize("arm", ["PSM1", "ECM", "MTML"])
def test_tips_of_several_arms_have_the_same_bits_and_are_those_of_each(both, arm):
    chains, random = [arms.chain(arm), copy.deepcopy(arms.chain(arm))], np.random.default_rng(4)
    chains[1].tip[:3, 3] += 0.01
    chains[1] = serial_chain.SerialChain(chains[1].joints, chains[1].tip)
    n = len(chains[0].joints)
    state, poses, twists = np.zeros((2, 2, 3, n)), np.zeros((2, 2, 4, 4)), np.zeros((2, 2, 6))
    tips = Tips(chains, state, poses, twists)

    def states():
        tips.update()
        return np.concatenate([each.ravel() for each in (poses, twists, tips.jacobian)])

    for _ in range(COUNT // 10):
        state[:] = random.uniform(-2.0, 2.0, state.shape)
        assert len(set(both(states))) == 1
        frames = chains[1].frames(state[1, 1, 0])
        assert np.array_equal(poses[1, 1], frames[-1])
        assert np.array_equal(tips.jacobian[1], chains[1].jacobian(frames))
        assert np.allclose(twists[1, 1], tips.jacobian[1] @ state[1, 1, 1])


@pytest.mark.parametrize("wrong", [None, np.nan, np.inf])
def test_poses_of_tips_have_the_same_bits(both, wrong):
    random = np.random.default_rng(5)
    for _ in range(COUNT // 10):
        base, tips = np.tile(np.eye(4), (3, 1, 1)), np.tile(np.eye(4), (3, 2, 1, 1))
        for pose in (*base, *tips.reshape(-1, 4, 4)):
            pose[:3, :3] = rotation.matrix(rotation.exp(random.normal(0.0, 2.0, 3)))
            pose[:3, 3] = random.normal(0.0, 1.0, 3)
        if wrong is not None:
            tips[1, 0, 2, 1] = wrong

        def written(base=base, tips=tips):
            poses = np.zeros((3, 5, 7))
            tip_poses(base, tips, poses)
            return poses

        with np.errstate(invalid="ignore"):
            assert len(set(both(written))) == 1
            outside, found = base[2] @ tips[2, 1], written()[2, 4]
        assert np.array_equal(found, [*outside[:3, 3], *rotation.from_matrix(outside)])


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e100])
def test_what_is_no_pose_is_left_to_python(both, wrong):
    chain = arms.chain("PSM1")
    home = (chain.lower + chain.upper) / 2.0
    for i in range(16):
        pose = chain.frames(home)[-1]
        pose.reshape(-1)[i] = wrong
        found, expected = both(inverse.inverse, chain, pose, home)
        assert found == expected
        assert isinstance(found, str)


def test_arrays_of_other_forms_are_left_to_python():
    chain = arms.chain("PSM1")
    home = (chain.lower + chain.upper) / 2.0
    others = (home[:5], home[None], np.repeat(home, 2)[::2], home.astype(np.float32), home.tolist(), None)
    for other in others:
        assert serial_chain.compiled.frames(chain.numbers, other) is None
    assert serial_chain.compiled.frames(chain.numbers[:4], home) is None
    assert serial_chain.compiled.frames(chain.numbers) is None
    with pytest.raises(MotionError, match="shape"):
        chain.frames(home[:5])


def test_a_chain_can_be_copied():
    chain = arms.chain("PSM1")
    home = (chain.lower + chain.upper) / 2.0
    for other in (copy.deepcopy(chain), pickle.loads(pickle.dumps(chain))):
        assert other.frames(home).tobytes() == chain.frames(home).tobytes()


def test_doctor_says_which_code_runs(monkeypatch):
    assert serial_chain.check()[:2] == (True, "compiled")
    monkeypatch.setattr(serial_chain, "compiled", None)
    works, detail, remedy = serial_chain.check()
    assert not works
    assert "the same results" in detail
    assert "compiler" in remedy
