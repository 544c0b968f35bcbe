"""A network that sees: stereo pictures and features of the hands become the actions of the next steps.

Convolutions turn the picture of each eye into maps; the mean place of a map is a keypoint (Levine et al.,
JMLR 2016), as fine as a fraction of a pixel. Places of all keypoints and the features decide on a chunk of
actions, as in ACT (Zhao et al., RSS 2023). ACT's latent style is left out: a script has a single style.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from schemas.errors import ScenarioError

__all__ = ["PictureNetwork", "mean_places"]

KEYPOINTS, WIDTH = 64, 512
_CHANNELS = 64
_REACH = 8.0
"""Coordinates of a picture's edges: places differ by about 1 then."""


class PictureNetwork(nn.Module):
    """Stereo pictures and features to actions.

    Args:
        features: number of features.
        numbers: numbers of an action.
        steps: number of predicted steps.
    """

    mean: Tensor
    """Mean of the features, shape (n,)."""
    scale: Tensor
    """Standard deviation of the features, shape (n,)."""

    def __init__(self, features: int, numbers: int, steps: int) -> None:
        super().__init__()
        self.steps = steps
        self.register_buffer("mean", torch.zeros(features))
        self.register_buffer("scale", torch.ones(features))
        self.maps = nn.Sequential(
            *_convolution(3, 32, kernel=5, stride=2),
            *_convolution(32, _CHANNELS, stride=2),
            *_convolution(_CHANNELS, _CHANNELS, dilation=2),
            *_convolution(_CHANNELS, _CHANNELS, dilation=4),
            nn.Conv2d(_CHANNELS, KEYPOINTS, 1),
        )
        self.actions = nn.Sequential(
            nn.Linear(2 * 2 * KEYPOINTS + features, WIDTH),
            nn.ReLU(),
            nn.Linear(WIDTH, WIDTH),
            nn.ReLU(),
            nn.Linear(WIDTH, WIDTH),
            nn.ReLU(),
            nn.Linear(WIDTH, steps * numbers),
        )

    def forward(self, pictures: Tensor, features: Tensor) -> Tensor:
        """Return actions, shape (n, steps * numbers).

        Args:
            pictures: uint8, shape (n, 2, height, width, 3).
            features: float32, shape (n, features).
        """
        count = len(pictures)
        eyes = pictures.flatten(0, 1).permute(0, 3, 1, 2).float() / 127.5 - 1.0
        places = mean_places(self.maps(eyes)).reshape(count, -1)
        return self.actions(torch.cat([places, (features - self.mean) / self.scale], dim=1))

    def normalise(self, features: Tensor) -> None:
        """Know the mean and the spread of the features, shape (n, features)."""
        self.mean.copy_(features.mean(dim=0))
        self.scale.copy_(features.std(dim=0) + 1e-3)

    def save(self, file: Path) -> None:
        """Write the weights into an .npz file."""
        arrays: dict[str, Any] = {name: value.cpu().numpy() for name, value in self.state_dict().items()}
        np.savez(file, steps=np.array(self.steps), **arrays)

    @classmethod
    def load(cls, file: Path) -> PictureNetwork:
        """Read a file of `save`; nothing is unpickled. Raises ScenarioError for another file."""
        try:
            with file.open("rb") as opened, np.load(opened, allow_pickle=False) as arrays:
                values = {name: torch.from_numpy(arrays[name]) for name in arrays.files if name != "steps"}
                steps = int(arrays["steps"])
                network = cls(len(values["mean"]), len(values["actions.6.bias"]) // steps, steps)
                network.load_state_dict(values)
                return network.eval()
        except (
            OSError,
            EOFError,
            ValueError,
            KeyError,
            TypeError,
            RuntimeError,
            zipfile.BadZipFile,
        ) as error:
            raise ScenarioError(
                f"'{file}' holds no network of pictures ({error}): train it with"
                " `python -m learning.policies EXERCISE --pictures`"
            ) from error


def _convolution(
    inputs: int, outputs: int, *, kernel: int = 3, stride: int = 1, dilation: int = 1
) -> tuple[nn.Module, ...]:
    around = dilation * (kernel // 2)
    layer = nn.Conv2d(inputs, outputs, kernel, stride=stride, padding=around, dilation=dilation)
    return layer, nn.GroupNorm(8, outputs), nn.ReLU()


def mean_places(maps: Tensor) -> Tensor:
    """Return the mean place of each map's softmax, shape (n, maps, 2); edges are at -_REACH and _REACH."""
    height, width = maps.shape[-2:]
    shares = maps.flatten(2).softmax(dim=2).reshape(maps.shape)
    across = torch.linspace(-_REACH, _REACH, width, device=maps.device)
    down = torch.linspace(-_REACH, _REACH, height, device=maps.device)
    return torch.stack([shares.sum(dim=2) @ across, shares.sum(dim=3) @ down], dim=2)
