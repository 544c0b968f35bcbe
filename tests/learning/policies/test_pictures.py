"""Behaviour cloning from pictures: demonstrations in files, features of hands, network, training, policy."""

import numpy as np
import pytest

from engines.mujoco.pictures import opengl
from learning.environments.registration import ENVIRONMENTS, make
from learning.judge.episode import Trial, judge_trial, make_environment
from learning.policies.demonstration import STEPS, Demonstration, chunks, load_demonstrations
from learning.policies.demonstrations import FIRST_SEED, demonstrate
from learning.policies.hand_features import HandFeatures
from schemas.errors import ScenarioError

TRIAL = Trial("NeedlePick", "nominal", 0)
HEIGHT, WIDTH = 24, 32


def spots(count, steps=6):
    """Return demonstrations of an action that points to a bright spot, seen by both eyes."""
    made = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        pictures = np.zeros((steps, 2, HEIGHT, WIDTH, 3), np.uint8)
        down, across = rng.integers(2, HEIGHT - 2), rng.integers(2, WIDTH - 2)
        pictures[:, :, down - 2 : down + 2, across - 2 : across + 2] = 255
        action = np.array([across / WIDTH - 0.5, down / HEIGHT - 0.5, 0.0, 0.0, 1.0])
        made.append(
            Demonstration(
                FIRST_SEED + seed, rng.normal(size=(steps, 3)), np.tile(action, (steps, 1)), pictures
            )
        )
    return made


def test_demonstrations_come_back_from_their_files_by_seed(tmp_path):
    made = spots(2)
    for each in reversed(made):
        each.save(tmp_path / f"{each.seed}.npz")
    for read, each in zip(load_demonstrations(tmp_path), made, strict=True):
        assert read.seed == each.seed
        for one, other in zip(read[1:], each[1:], strict=True):
            assert one.dtype == other.dtype
            assert (one == other).all()


def test_a_demonstration_without_pictures_comes_back(tmp_path):
    spots(1)[0]._replace(pictures=None).save(tmp_path / "a.npz")
    assert Demonstration.load(tmp_path / "a.npz").pictures is None


def test_another_file_is_no_demonstration(tmp_path):
    (tmp_path / "a.npz").write_bytes(b"text")
    with pytest.raises(ScenarioError, match="holds no demonstration"):
        load_demonstrations(tmp_path)


def test_features_of_hands_tell_nothing_of_objects():
    env = make_environment(TRIAL, {})
    observation, _ = env.reset(seed=3)
    features = HandFeatures(env)
    before = features(observation)
    for name, part in env.layout.items():
        if name.startswith("needle/"):
            observation["observation"][part] += 0.1
    observation["achieved_goal"] += 0.1
    assert (features(observation) == before).all()
    observation["observation"][env.layout["PSM1/tip/position"]] += 0.01
    assert not (features(observation) == before).all()
    env.close()


def test_demonstrations_with_pictures_are_those_without():
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    kind, steps = ENVIRONMENTS["trocar/NeedlePick-v0"]
    made = []
    for arguments in ({}, {"images": True, "width": WIDTH, "height": HEIGHT}):
        env = make(kind, terminate_on_success=True, hashed=False, **arguments)
        made += demonstrate(env, 1, steps, 0.1, 12_345)
        env.close()
    plain, seen = made
    assert (plain.seed, plain.pictures) == (seen.seed, None)
    assert (plain.actions == seen.actions).all()
    assert seen.pictures.shape == (len(seen.actions), 2, HEIGHT, WIDTH, 3)
    assert seen.pictures.std() > 0.0


def test_places_of_maps_are_those_of_their_peaks():
    torch = pytest.importorskip("torch")
    from learning.policies.picture_network import mean_places

    maps = torch.zeros(1, 2, 5, 9)
    maps[0, 0, 0, 8], maps[0, 1, 2, 2] = 100.0, 100.0
    assert mean_places(maps)[0].numpy() == pytest.approx(np.array([[8.0, -8.0], [-4.0, 0.0]]), abs=1e-4)


def test_training_finds_a_spot(tmp_path):
    torch = pytest.importorskip("torch")
    from learning.policies.picture_network import PictureNetwork
    from learning.policies.picture_training import train_from_pictures

    made = spots(20, steps=2)
    network, progress = next(train_from_pictures(made, 40, seed=3))
    assert progress.held_out < 0.06  # 0.085 with the mean action
    features, _ = chunks(made)
    seen = torch.from_numpy(made[0].pictures), torch.tensor(features[:2], dtype=torch.float32)
    with torch.no_grad():
        answer = network(*seen)
        assert answer.shape == (2, STEPS * 5)
        network.save(tmp_path / "a.npz")
        assert (PictureNetwork.load(tmp_path / "a.npz")(*seen) == answer).all()


def test_training_is_the_same_for_the_same_seed():
    pytest.importorskip("torch")
    from learning.policies.picture_training import train_from_pictures

    made = spots(3, steps=2)
    (network, progress), (other, again) = (next(train_from_pictures(made, 3, seed=3)) for _ in range(2))
    assert progress[:2] == again[:2]
    for one, another in zip(network.parameters(), other.parameters(), strict=True):
        assert (one == another).all()


def test_another_file_is_no_network_of_pictures(tmp_path):
    pytest.importorskip("torch")
    from learning.policies.picture_network import PictureNetwork

    spots(1)[0].save(tmp_path / "a.npz")
    with pytest.raises(ScenarioError, match="holds no network of pictures"):
        PictureNetwork.load(tmp_path / "a.npz")


def test_a_policy_goes_to_the_mean_of_all_places_predicted_for_a_step(monkeypatch):
    torch = pytest.importorskip("torch")
    from learning.policies import picture_policy

    rows = iter([[0.4, 0.2, 0.0, 0.0], [0.6, 0.0, 0.0, 0.0], [-0.1, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0]])

    def network(pictures, features):
        assert pictures.shape == (1, 2, HEIGHT, WIDTH, 3)
        chunk = np.zeros((STEPS, 5))
        chunk[:, 0], chunk[:, 4] = next(rows), -0.1
        return torch.tensor(chunk.reshape(1, -1))

    monkeypatch.setattr(picture_policy.PictureNetwork, "load", lambda _: network)
    monkeypatch.setattr(picture_policy.Path, "is_file", lambda _: True)
    env = make_environment(TRIAL, {})
    observation, _ = env.reset(seed=0)
    observation |= {eye: np.zeros((HEIGHT, WIDTH, 3), np.uint8) for eye in ("left", "right")}
    policy = picture_policy.PicturePolicy()
    policy.begin(env, 0)
    acted = [policy.act(observation)[[0, 4]] for _ in range(4)]
    env.close()
    places = np.cumsum(acted, axis=0)[:, 0]
    assert places[0] == pytest.approx(0.4)
    assert places[1] == pytest.approx(np.mean([0.6, 0.4 + 0.6]))  # of the first and the second chunk
    assert places[2] == pytest.approx(np.mean([0.6, 1.0, places[1] - 0.1]))
    assert places[3] == pytest.approx(np.mean([0.6, 1.0, places[1] - 0.1, places[2] + 1.0]))  # 3 is clipped
    assert [jaw for _, jaw in acted] == [-1.0] * 4


def test_a_policy_without_its_network_says_how_to_train(tmp_path, monkeypatch):
    pytest.importorskip("torch")
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    from learning.policies.picture_policy import PicturePolicy

    monkeypatch.chdir(tmp_path)
    env = make_environment(TRIAL, PicturePolicy.environment)
    row = judge_trial(env, PicturePolicy(), TRIAL, None)
    env.close()
    assert "--pictures" in row["error"]
