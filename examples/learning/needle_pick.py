"""Learns to pick a needle up by imitation, on one core in some minutes.

    python examples/learning/needle_pick.py --figure docs/pictures/learning.svg

DAgger (Ross, Gordon and Bagnell, AISTATS 2011): a network with two hidden layers is trained on what a
scripted teacher would do in the states that the network itself comes to. The teacher looks at the observation
alone and remembers nothing, so it can be asked anywhere. The curve is the share of 20 unseen episodes that
succeed by SurRoL's rule: the middle of the needle within 5 mm of the goal at the end.
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path

import trocar.environments  # isort: skip  # noqa: F401  (before numpy)

import gymnasium
import numpy as np

ROUNDS, EPISODES, STEPS, TRIALS = 10, 3, 25, 20
RADIUS, BITE, HOVER = 11.44e-3, 9.2e-3, 0.03
"""Of the needle; heights of a tip that takes it, and of one that is over it. Metres."""


def features(observation: dict[str, np.ndarray]) -> np.ndarray:
    """Return what teacher and network see, shape (12,): lengths in units of 10 mm."""
    tip, jaw, thing, goal = (
        observation["observation"][:7].astype(float),
        float(observation["observation"][7]),
        observation["observation"][8:].astype(float),
        observation["desired_goal"].astype(float),
    )
    middle = observation["achieved_goal"].astype(float)
    # twice the angle from the way the jaw opens to the needle's x axis: half a turn is none
    turn = 2.0 * (yaw(thing[3:7], 0) - yaw(tip[3:], 1))
    height = tip[2] - BITE
    return np.concatenate(
        [
            100.0 * (middle - tip[:3])[:2],
            [100.0 * height, np.sin(turn), np.cos(turn), 5.0 * jaw, thing[7]],
            100.0 * (goal - middle) * thing[7],
            [np.hypot(*(middle - tip[:3])[:2]) < 2e-3, height < 2e-3],
        ]
    )


def yaw(quaternion: np.ndarray, axis: int) -> float:
    """Return the angle (rad) of an axis of an orientation (x, y, z, w) about the world's z."""
    x, y, z, w = quaternion
    if axis == 0:
        return float(np.arctan2(2 * (x * y + z * w), 1 - 2 * (y * y + z * z)))
    return float(np.arctan2(1 - 2 * (x * x + z * z), 2 * (x * y - z * w)))


def teacher(seen: np.ndarray) -> np.ndarray:
    """Return what to do, shape (5,): go over the needle, down, close, and then to the goal."""
    x, y, height, sine, cosine, _, held = seen[:7]
    turn = 0.5 * np.arctan2(sine, cosine)
    aligned = np.hypot(x, y) < 0.2 and abs(turn) < 0.15
    if held:
        return np.array([*np.clip(seen[7:10], -1.0, 1.0), 0.0, -1.0])
    down = -height if aligned else HOVER * 100.0 - height
    near = aligned and height < 0.15
    return np.array(
        [*np.clip([x, y, down], -1.0, 1.0), np.clip(turn / (np.pi / 6), -1, 1), -1.0 if near else 1.0]
    )


class Network:
    """Two hidden layers, trained by Adam on squared errors."""

    def __init__(self, rng: np.random.Generator, sizes: tuple[int, ...] = (12, 96, 96, 5)) -> None:
        self.weights = [rng.normal(0.0, a**-0.5, (a, b)) for a, b in pairwise(sizes)]
        self.weights += [np.zeros(b) for b in sizes[1:]]
        self.moments = [np.zeros_like(w) for w in self.weights], [np.zeros_like(w) for w in self.weights]
        self.count, self.rng = 0, rng

    def layers(self, inputs: np.ndarray) -> list[np.ndarray]:
        """Return what every layer puts out, the input first."""
        found, n = [inputs], len(self.weights) // 2
        for i in range(n):
            out = found[-1] @ self.weights[i] + self.weights[n + i]
            found.append(np.tanh(out))
        return found

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """Return actions, shape (..., 5)."""
        return self.layers(inputs)[-1]

    def train(self, inputs: np.ndarray, wanted: np.ndarray, epochs: int) -> float:
        """Fit; return the mean squared error of the last epoch."""
        loss = 0.0
        for _ in range(epochs):
            for rows in np.array_split(self.rng.permutation(len(inputs)), max(1, len(inputs) // 64)):
                loss = self.descend(inputs[rows], wanted[rows])
        return loss

    def descend(self, inputs: np.ndarray, wanted: np.ndarray, rate: float = 2e-3) -> float:
        """Take one step of Adam; return the mean squared error before it."""
        found, n = self.layers(inputs), len(self.weights) // 2
        error = found[-1] - wanted
        gradients: list[np.ndarray] = [np.zeros(0)] * (2 * n)
        back = error * (1.0 - found[-1] ** 2) / len(inputs)
        for i in reversed(range(n)):
            gradients[i], gradients[n + i] = found[i].T @ back, back.sum(axis=0)
            back = (back @ self.weights[i].T) * (1.0 - found[i] ** 2)
        self.count += 1
        first, second = self.moments
        for i, gradient in enumerate(gradients):
            first[i] = 0.9 * first[i] + 0.1 * gradient
            second[i] = 0.999 * second[i] + 0.001 * gradient**2
            mean, scale = first[i] / (1 - 0.9**self.count), second[i] / (1 - 0.999**self.count)
            self.weights[i] = self.weights[i] - rate * mean / (np.sqrt(scale) + 1e-8)
        return float((error**2).mean())


def collect(env: gymnasium.Env, network: Network | None, seeds: range) -> tuple[np.ndarray, np.ndarray]:
    """Return the states to which the network leads, or the teacher, and what the teacher would do there."""
    inputs, wanted = [], []
    for seed in seeds:
        observation, _ = env.reset(seed=seed)
        for _ in range(STEPS):
            inputs.append(features(observation))
            wanted.append(teacher(inputs[-1]))
            action = wanted[-1] if network is None else network(inputs[-1])
            observation, _, ended, _, _ = env.step(action)
            if ended:
                break
    return np.array(inputs), np.array(wanted)


def succeeded(env: gymnasium.Env, network: Network) -> float:
    """Return the share of unseen episodes that the network ends with the needle at its goal."""
    count = 0
    for seed in range(10_000, 10_000 + TRIALS):
        observation, info = env.reset(seed=seed)
        for _ in range(STEPS):
            observation, _, ended, _, info = env.step(network(features(observation)))
            if ended:
                break
        count += bool(info["is_success"])
    return count / TRIALS


def train() -> list[tuple[int, float]]:
    """Return how many steps were asked of the teacher, and the success then, for each round."""
    env = gymnasium.make("trocar/NeedlePick-v0")
    network = Network(np.random.default_rng(0))
    inputs, wanted = np.zeros((0, 12)), np.zeros((0, 5))
    curve = [(0, succeeded(env, network))]
    for number in range(ROUNDS):
        seeds = range(number * EPISODES, (number + 1) * EPISODES)
        more = collect(env, network if number else None, seeds)
        inputs, wanted = np.concatenate([inputs, more[0]]), np.concatenate([wanted, more[1]])
        loss = network.train(inputs, wanted, epochs=150)
        curve.append((len(inputs), succeeded(env, network)))
        print(
            f"round {number + 1}: {len(inputs)} steps, error {loss:.4f}, success {curve[-1][1]:.2f}",
            flush=True,
        )
    env.close()
    return curve


def draw(curve: list[tuple[int, float]], file: Path) -> None:
    """Draw the curve."""
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "trocar"
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(5.5, 3.0), layout="constrained")
    axes.plot(*zip(*curve, strict=True), marker="o", color="#1f6f8b")
    axes.set(xlabel="steps that the teacher has commented on", ylabel="success", ylim=(-0.05, 1.05))
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="y", alpha=0.3)
    figure.savefig(file, metadata={"Date": None} if file.suffix == ".svg" else None)


def main() -> None:
    """Train, print the curve, and draw it if asked to."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--figure", type=Path, help="draw the curve into this file")
    asked = parser.parse_args()
    curve = train()
    if asked.figure:
        draw(curve, asked.figure)


if __name__ == "__main__":
    main()
