"""Environments: Gymnasium's own check, seeds, rewards, bad actions, recordings, many at once."""

import subprocess
import sys
import warnings
from functools import partial

import av
import gymnasium
import numpy as np
import pytest
from gymnasium.error import InvalidAction
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv
from gymnasium.wrappers import RecordVideo

import trocar
from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.filament import backend
from learning.environments.goals import event_bonus
from schemas.errors import RecordingError, SessionError, TrocarError
from schemas.ros import Header, Point, Pose, PoseStamped, Quaternion
from trocar.environments import ENVIRONMENTS, oracle

pytestmark = pytest.mark.xdist_group("environments")
IDS = sorted(name for name in ENVIRONMENTS if "Retraction" not in name)
STEPS = 4


def actions(seed, size):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (STEPS, size))


@pytest.fixture(scope="module")
def needle():
    env = gymnasium.make("trocar/NeedlePick-v0")
    yield env
    env.close()


def episode(env, seed):
    """Return the state hash and the last observation of some random steps."""
    env.reset(seed=seed)
    for action in actions(seed, env.action_space.shape[0]):
        observation, *_ = env.step(action)
    return env.unwrapped.state_hash, observation["observation"]


@pytest.mark.long
@pytest.mark.parametrize("name", IDS)
def test_gymnasium_finds_nothing_to_complain_of(name):
    env = gymnasium.make(name)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    env.close()


def test_the_seed_decides_the_episode(needle):
    first, other = episode(needle, 3), episode(needle, 4)
    again = episode(needle, 3)
    assert first[0] == again[0]
    assert np.array_equal(first[1], again[1])
    assert first[0] != other[0]


@pytest.mark.long
def test_episodes_of_a_vector_are_those_of_one_process(needle):
    alone = [episode(needle, seed)[0] for seed in (3, 4)]
    make = partial(gymnasium.make, "trocar.environments:trocar/NeedlePick-v0")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        many = AsyncVectorEnv([make, make], context="spawn")
    try:
        many.reset(seed=3)  # 3 and 4
        for both in zip(actions(3, 5), actions(4, 5), strict=True):
            many.step(np.array(both))
        assert list(many.get_attr("state_hash")) == alone
    finally:
        many.close()


def test_what_has_left_the_table_ends_the_episode_and_is_back_at_reset(needle):
    first, _ = needle.reset(seed=3)
    beside = PoseStamped(
        header=Header(frame_id="world"),
        pose=Pose(position=Point(x=1.0, z=0.05), orientation=Quaternion(w=1.0)),
    )
    needle.unwrapped._session.advance(1, {"robot.needle/place": (beside,)})
    _, _, terminated, _, info = needle.step(np.zeros(5))
    assert terminated
    assert not info["is_success"]
    again, _ = needle.reset(seed=3)
    assert np.array_equal(again["observation"], first["observation"])


def test_an_action_that_is_too_large_is_clipped(needle):
    needle.reset(seed=0)
    needle.step(np.ones(5))
    clipped = needle.unwrapped.state_hash
    needle.reset(seed=0)
    needle.step(np.full(5, 7.0))
    assert needle.unwrapped.state_hash == clipped


@pytest.mark.parametrize("action", [np.zeros(4), np.zeros((1, 5)), np.full(5, np.nan), [0, 0, np.inf, 0, 0]])
def test_an_action_that_is_none_is_refused(needle, action):
    needle.reset(seed=0)
    with pytest.raises(InvalidAction, match=r"expected \(5,\) finite numbers.*PSM1"):
        needle.unwrapped.step(np.asarray(action))


def test_rewards_of_many_goals_are_those_of_one():
    for kind in ("sparse", "shaped"):
        env = gymnasium.make("trocar/Reach-v0", reward=kind).unwrapped
        observation, _ = env.reset(seed=1)
        rows = [env.step(action) for action in actions(1, 5)]
        achieved = np.stack([row[0]["achieved_goal"] for row in rows])
        desired = np.repeat(observation["desired_goal"][None], STEPS, axis=0)
        infos = [row[4] for row in rows]
        assert np.array_equal(env.compute_reward(achieved, desired, infos), [row[1] for row in rows])
        # hindsight: what was achieved had been the goal
        assert (env.compute_reward(achieved, achieved, infos) >= 0.0).all()
        env.close()


def test_a_recorded_episode_verifies(tmp_path):
    env = gymnasium.make("trocar/NeedlePick-v0", record=tmp_path, max_episode_steps=STEPS)
    hashes = [episode(env, seed)[0] for seed in (5, 6)]
    env.close()
    for number, state_hash in enumerate(hashes):
        place = tmp_path / f"episode-{number:05d}"
        found = trocar.verify(place)
        assert found.same
        assert found.steps == 10 * STEPS + 1
        recording = trocar.Recording(place)
        assert {"robot.needle/pose", "task.score", "actions.PSM1/goal_cp"} <= set(recording)
        assert state_hash
    with pytest.raises(RecordingError):
        trocar.SteppedSession(env.unwrapped._session._loaded).restart(tmp_path / "episode-00000")


def test_a_success_may_end_an_episode():
    env = gymnasium.make("trocar/Reach-v0", terminate_on_success=True)
    observation, _ = env.reset(seed=2)
    policy, ended = oracle(env.unwrapped), False
    while not ended:
        observation, _, ended, late, info = env.step(policy(observation))
        assert not late
    assert info["is_success"]
    env.close()


@pytest.mark.parametrize("name", ["NeedlePick", "PegTransfer"])
def test_an_oracle_does_what_surrol_s_does_in_as_many_steps(name):
    env = gymnasium.make(f"trocar/{name}-v0")
    observation, _ = env.reset(seed=0)
    policy, info = oracle(env.unwrapped), {"is_success": False}
    for _ in range(50):
        observation, _, _, _, info = env.step(policy(observation))
        if info["is_success"]:
            break
    assert info["is_success"]
    env.close()


@pytest.mark.long
def test_tissue_is_grasped_and_lifted_and_a_new_episode_has_it_where_it_was(tmp_path):
    """The second episode begins with restored tissue; it is simulated again with new one."""
    pytest.importorskip("pybullet")
    env = gymnasium.make("trocar/Retraction-v0", reward="shaped", record=tmp_path)
    hashes = []
    for steps in (8, 4):
        observation, _ = env.reset(seed=0)
        policy = oracle(env.unwrapped)
        for _ in range(steps):
            observation, *_, info = env.step(policy(observation))
            hashes.append(env.unwrapped.state_hash)
        assert info["is_success"] == (steps == 8)
    assert hashes[8:] == hashes[:4]
    env.close()
    assert trocar.verify(tmp_path / "episode-00001").same


@pytest.mark.long
def test_a_sheet_is_burnt_off_its_bed_and_is_whole_in_a_new_episode(tmp_path):
    env = gymnasium.make("trocar/Dissect-v0", reward="shaped", record=tmp_path)
    dead, hashes, bonuses = env.unwrapped.layout["tissue/dead"], list[list[str]](), list[float]()
    for most in (60, 4):
        observation, _ = env.reset(seed=3)
        assert observation["achieved_goal"] == 0.0
        policy, info, bonus = oracle(env.unwrapped), {"is_success": False}, 0.0
        hashes.append([])
        while len(hashes[-1]) < most and not info["is_success"]:
            observation, *_, info = env.step(policy(observation))
            hashes[-1].append(env.unwrapped.state_hash)
            bonus += info["bonus"]
        assert info["is_success"] == (most == 60)
        assert bonus == pytest.approx(-1e7 * observation["observation"][dead][0], rel=1e-3)
        bonuses.append(bonus)
    assert bonuses[0] < 0.0, "some of the bed has died"
    assert hashes[1] == hashes[0][:4]
    env.close()
    assert trocar.verify(tmp_path / "episode-00001").same


@pytest.mark.long
def test_a_strip_is_cut_off_and_whole_in_a_new_episode(tmp_path):
    env = gymnasium.make("trocar/TissueCut-v0", reward="shaped", record=tmp_path)
    bonus, hashes = 0.0, list[list[str]]()
    for most in (30, 8):
        observation, _ = env.reset(seed=0)
        assert observation["achieved_goal"] == 0.0
        policy, info = oracle(env.unwrapped), {"is_success": False}
        hashes.append([])
        while len(hashes[-1]) < most and not info["is_success"]:
            observation, *_, info = env.step(policy(observation))
            hashes[-1].append(env.unwrapped.state_hash)
            bonus += info["bonus"]
        assert info["is_success"] == (most == 30)
    assert bonus == 0.5, "a first cut, and no tear"
    assert hashes[1] == hashes[0][:8]
    env.close()
    assert trocar.verify(tmp_path / "episode-00001").same


def test_a_loss_counts_each_time_and_the_rest_once():
    seen = set[str]()
    assert event_bonus(["cut", "cut", "torn"], seen) == 0.5 - 1.0
    assert event_bonus(["cut", "torn", "dropped"], seen) == -2.0


def test_what_is_unknown_is_refused():
    for arguments, problem in (
        ({"reward": "dense"}, "neither 'sparse' nor 'shaped'"),
        ({"render_mode": "human"}, "neither None nor"),
        ({"step": 0.015}, "no multiple"),
    ):
        with pytest.raises(Exception, match=problem):
            gymnasium.make("trocar/Reach-v0", **arguments)


def test_without_gymnasium_the_sentence_says_what_mends_it():
    program = (
        "import sys; sys.modules['gymnasium'] = None\n"
        "try:\n    import trocar.environments\nexcept Exception as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=True)
    assert "pip install 'trocar[gym]'" in done.stdout


@pytest.mark.long
def test_a_fresh_process_needs_no_import_of_ours():
    program = (
        "import gymnasium; made = gymnasium.make('trocar.environments:trocar/Reach-v0'); made.reset(seed=1);"
        "made.close(); print(made.spec.id)"
    )
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "trocar/Reach-v0\n"


def test_a_gymnasium_that_loads_plug_ins_finds_all_ids():
    program = (
        "import gymnasium; from importlib.metadata import entry_points;"
        "(plugin,) = entry_points(group='gymnasium.envs', name='__root__'); plugin.load()();"
        "print(*sorted(name for name in gymnasium.registry if name.startswith('trocar/')))"
    )
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == sorted(ENVIRONMENTS)


@pytest.mark.parametrize(
    "action",
    ["up", ["a", "b", "c", "d", "e"], [1j, 0, 0, 0, 0], [[0.0], [1.0, 2.0]], None, [float("nan")] * 5, [0.0]],
    ids=str,
)
def test_an_action_that_is_none_is_refused_with_a_sentence(needle, action):
    needle.reset(seed=3)
    for kind in (TrocarError, InvalidAction):
        with pytest.raises(kind, match=r"expected \(5,\) finite numbers"):
            needle.unwrapped.step(action)


def test_after_close_a_sentence():
    env = gymnasium.make("trocar/Reach-v0").unwrapped
    env.reset(seed=1)
    env.close()
    for call in (env.reset, env.render, lambda: env.step(np.zeros(5))):
        with pytest.raises(SessionError, match="closed: make a new one"):
            call()
    env.close()


@pytest.mark.long
def test_gymnasium_records_a_film(tmp_path):
    pytest.importorskip("moviepy")
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    made = gymnasium.make("trocar/Reach-v0", render_mode="rgb_array")
    env = RecordVideo(made, str(tmp_path / "films"), episode_trigger=lambda _: True)
    env.reset(seed=1)
    for action in actions(1, 5):
        env.step(action)
    env.close()
    with av.open(str(tmp_path / "films/rl-video-episode-0.mp4")) as film:
        assert len(list(film.decode(video=0))) == STEPS + 1


@pytest.mark.parametrize("steps", [1, 1.5, 2])
def test_old_observations_are_those_of_the_past(steps):
    now = gymnasium.make("trocar/Reach-v0")
    late = gymnasium.make("trocar/Reach-v0", delay=0.2 * steps)
    (first, _), (old, _) = now.reset(seed=3), late.reset(seed=3)
    seen = [first, first, first]
    for action in actions(3, 5):
        new, reward, *_ = now.step(action)
        old, same, *_ = late.step(action)
        seen.append(new)
        assert same == reward  # of now
        past = seen[-1 - int(steps)]["observation"]
        if steps != 1.5 or len(seen) == 4:  # nothing is older than the first observation
            np.testing.assert_array_equal(old["observation"], past)
        else:
            before = seen[-3]["observation"]
            assert not np.array_equal(old["observation"], past)
            assert not np.array_equal(old["observation"], before)
            assert np.linalg.norm((old["observation"] - past)[:3]) < 0.01
    assert late.unwrapped.state_hash == now.unwrapped.state_hash
    now.close()
    late.close()


def test_a_delay_is_a_multiple_of_the_scenarios_step():
    with pytest.raises(ValueError, match=r"delay 0\.001 s is no multiple of the scenario's 0\.02 s"):
        gymnasium.make("trocar/Reach-v0", delay=0.001)


def test_encoders_with_offsets_lie_to_the_policy():
    errors = {"participants.actions.joint_errors": {"PSM1": ["2 deg", "0 deg", "0 mm"]}}
    env = gymnasium.make("trocar/Reach-v0", settings=errors)
    true = gymnasium.make("trocar/Reach-v0")
    (told, _), (truth, _) = env.reset(seed=3), true.reset(seed=3)
    for _ in range(3):
        told, *_ = env.step(np.zeros(5))
        truth, *_ = true.step(np.zeros(5))
    # the servo follows the encoder: the arm stands elsewhere, and the encoder says where it was sent
    np.testing.assert_allclose(told["observation"][:3], truth["observation"][:3], atol=2e-4)
    off = np.linalg.norm(told["achieved_goal"] - truth["achieved_goal"])
    assert off == pytest.approx(np.radians(2.0) * 0.15, rel=0.2)
    env.close()
    true.close()


def test_an_episode_is_recorded_where_reset_says(needle, tmp_path):
    needle.reset(seed=1, options={"record": tmp_path / "mine"})
    needle.step(np.zeros(5))
    needle.reset(seed=2)
    assert trocar.verify(tmp_path / "mine").same
    with pytest.raises(ValueError, match="there is only 'record'"):
        needle.reset(options={"recrod": tmp_path})


@pytest.mark.long
def test_the_seed_of_an_episode_decides_its_looks_and_the_recording_states_them(tmp_path):
    if not (found := backend.find()).name:
        pytest.skip(f"no Filament: {found.detail}")
    arguments = {"images": True, "looks": "endoscope", "randomise": {"turn": 0.0}, "record": tmp_path}
    env = gymnasium.make("trocar/Reach-v0", width=64, height=48, **arguments)
    one, other, again = (env.reset(seed=seed)[0]["left"] for seed in (1, 2, 1))
    env.close()
    assert np.array_equal(one, again)
    assert np.abs(one.astype(int) - other).mean() > 3.0
    recordings = [trocar.Recording(tmp_path / f"episode-0000{k}") for k in range(3)]
    states = [recording.scenario().participants["camera"].params["randomise"] for recording in recordings]
    assert states[0] == states[2] != states[1]
    assert states[0]["turn"] == 0.0
    with pytest.raises(ValueError, match="'wet' is neither"):
        gymnasium.make("trocar/Reach-v0", looks="wet")
