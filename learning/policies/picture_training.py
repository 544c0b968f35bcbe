"""Behaviour cloning from pictures in PyTorch: minutes on a GPU, many hours on two cores."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import torch
from torch import Tensor, nn

from learning.policies.demonstration import STEPS, Demonstration, chunks
from learning.policies.picture_network import PictureNetwork

__all__ = ["Progress", "train_from_pictures"]

BATCH = 256
_RATE, _DECAY, _LARGEST_GRADIENT = 1e-3, 1e-4, 1.0
_WARMING = 0.05
"""Share of the batches in which the learning rate rises."""
_HELD_OUT = 20
"""Share of demonstrations that are not trained on: the last of so many."""
_REPORTED = 100
"""Batches between reports."""


class Progress(NamedTuple):
    """Mean absolute errors of actions after some batches."""

    iteration: int
    training: float
    held_out: float
    """Error on demonstrations that are not trained on; nan without any."""


class _Steps(NamedTuple):
    """All steps of demonstrations, in the memory of the device."""

    pictures: Tensor
    features: Tensor
    actions: Tensor

    @classmethod
    def of(cls, demonstrations: Sequence[Demonstration], device: torch.device) -> _Steps:
        features, actions = chunks(demonstrations)
        seen = [torch.from_numpy(each.pictures).to(device) for each in demonstrations]
        return cls(
            torch.cat(seen),
            torch.tensor(features, dtype=torch.float32, device=device),
            torch.tensor(actions, dtype=torch.float32, device=device),
        )

    def error(self, network: PictureNetwork, rows: Tensor) -> Tensor:
        """Return the mean absolute error of predicted actions."""
        predicted = network(self.pictures[rows], self.features[rows])
        return nn.functional.l1_loss(predicted, self.actions[rows])

    def batches(self) -> Iterator[Tensor]:
        """Yield the rows of each batch: all rows once in a new order, again and again."""
        count = len(self.features)
        while True:
            order = torch.randperm(count).to(self.pictures.device)
            yield from order.split(BATCH)[: max(1, count // BATCH)]


def train_from_pictures(
    demonstrations: Sequence[Demonstration], iterations: int, seed: int = 0
) -> Iterator[tuple[PictureNetwork, Progress]]:
    """Train a network, on a GPU if there is one; yield the network and its errors now and at the end.

    The same seed gives the same network on a CPU.

    Args:
        demonstrations: episodes with pictures.
        iterations: number of batches; the learning rate rises, then falls to 0 along a cosine.
        seed: of the first weights and of the batches.
    """
    torch.manual_seed(seed)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    kept = len(demonstrations) - len(demonstrations) // _HELD_OUT
    steps = _Steps.of(demonstrations[:kept], device)
    unseen = _Steps.of(demonstrations[kept:], device) if kept < len(demonstrations) else None
    network = PictureNetwork(steps.features.shape[1], steps.actions.shape[1] // STEPS, STEPS)
    network.normalise(steps.features)
    network.to(device)
    optimizer = torch.optim.AdamW(network.parameters(), lr=_RATE, weight_decay=_DECAY)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimizer, lambda i: _rate(i, iterations))
    errors: list[Tensor] = []
    for iteration, rows in zip(range(1, iterations + 1), steps.batches(), strict=False):
        error = steps.error(network, rows)
        optimizer.zero_grad()
        error.backward()
        nn.utils.clip_grad_norm_(network.parameters(), _LARGEST_GRADIENT)
        optimizer.step()
        schedule.step()
        errors.append(error.detach())
        if iteration % _REPORTED == 0 or iteration == iterations:
            training = float(torch.stack(errors).mean())
            errors.clear()
            yield network, Progress(iteration, training, _error_of(network, unseen))


def _rate(iteration: int, iterations: int) -> float:
    """Return the share of the largest learning rate."""
    rising = min(1.0, (iteration + 1) / (_WARMING * iterations))
    return rising * 0.5 * (1.0 + math.cos(math.pi * iteration / iterations))


def _error_of(network: PictureNetwork, steps: _Steps | None) -> float:
    if steps is None:
        return math.nan
    with torch.no_grad():
        parts = torch.arange(len(steps.features), device=steps.features.device).split(BATCH)
        errors = [float(steps.error(network, rows)) * len(rows) for rows in parts]
    return math.fsum(errors) / len(steps.features)
