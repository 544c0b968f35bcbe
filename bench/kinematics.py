"""How many configurations a second the kinematics take, one by one and ten thousand at once.

Run `python bench/kinematics.py`.
"""

from __future__ import annotations

import timeit
from collections.abc import Callable

import numpy as np

from robots.dvrk import arms
from robots.dvrk.inverse import inverse

COUNT = 10_000


def rate(call: Callable[[], object], configurations: int, repetitions: int) -> float:
    """Return configurations per second, the best of five."""
    return configurations * repetitions / min(timeit.repeat(call, number=repetitions, repeat=5))


def measure(arm: str) -> None:
    """Print one row per function."""
    chain = arms.chain(arm)
    many = np.random.default_rng(0).uniform(chain.lower, chain.upper, (COUNT, len(chain.joints)))
    one, poses, frames = many[0], chain.forward(many), chain.frames(many)
    rows: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
        "forward": (lambda: chain.forward(one), lambda: chain.forward(many)),
        "jacobian": (lambda: chain.jacobian(frames[0]), lambda: chain.jacobian(frames)),
        "inverse": (lambda: inverse(chain, poses[0], one), lambda: inverse(chain, poses, many)),
    }
    for name, (single, batch) in rows.items():
        print(
            f"{arm:5} {name:9} {rate(single, 1, 1000):10.0f} /s one by one  {rate(batch, COUNT, 5):10.0f} /s"
            f" {COUNT} at once"
        )


if __name__ == "__main__":
    measure("PSM1")
    measure("ECM")
