"""Behaviour cloning in PyTorch: a network learns the oracle's actions of the next steps from a state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import torch
from torch import nn

from learning.policies.demonstration import STEPS, Demonstration, chunks
from learning.policies.network import Network

__all__ = ["train"]

_WIDTH, _BATCH = 384, 256
_RATE, _DECAY = 1e-3, 1e-4


def train(demonstrations: Sequence[Demonstration], iterations: int, seed: int = 0) -> Network:
    """Return a network trained on demonstrations, the same for the same seed.

    The loss is the mean absolute error, as in ACT: unlike the squared error, small motions near an object
    count as much as large motions far away.

    Args:
        demonstrations: the episodes.
        iterations: number of batches; the learning rate falls to 0 along a cosine.
        seed: of the first weights and of the batches.
    """
    torch.manual_seed(seed)
    features, actions = chunks(demonstrations)
    mean, scale = features.mean(axis=0), features.std(axis=0) + 1e-3
    inputs = torch.tensor((features - mean) / scale, dtype=torch.float32)
    targets = torch.tensor(actions, dtype=torch.float32)
    layers = nn.Sequential(
        nn.Linear(inputs.shape[1], _WIDTH),
        nn.ReLU(),
        nn.Linear(_WIDTH, _WIDTH),
        nn.ReLU(),
        nn.Linear(_WIDTH, _WIDTH),
        nn.ReLU(),
        nn.Linear(_WIDTH, targets.shape[1]),
    )
    optimizer = torch.optim.AdamW(layers.parameters(), lr=_RATE, weight_decay=_DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, iterations)
    for rows in _batches(len(inputs), iterations):
        loss = nn.functional.l1_loss(layers(inputs[rows]), targets[rows])
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        schedule.step()
    linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
    return Network(
        mean,
        scale,
        [layer.weight.detach().numpy() for layer in linear],
        [layer.bias.detach().numpy() for layer in linear],
        STEPS,
    )


def _batches(count: int, iterations: int) -> Iterator[torch.Tensor]:
    """Yield the rows of each batch: all rows once in a new order, again and again."""
    left = torch.randperm(count)
    for _ in range(iterations):
        if len(left) < min(_BATCH, count):
            left = torch.randperm(count)
        yield left[:_BATCH]
        left = left[_BATCH:]
