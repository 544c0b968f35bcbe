"""Policies of a stranger: one that gives no numbers, and one that is no policy."""

from types import MappingProxyType
from typing import ClassVar

import numpy as np


class Failing:
    environment = MappingProxyType({})

    def begin(self, env, seed):
        self.left, self.shape, self.seed = 3, env.action_space.shape, seed

    def act(self, observation):
        self.left -= 1
        return np.full(self.shape, 0.0 if self.left or self.seed else np.nan)


class Held(Failing):
    """A policy that says when it is held."""

    said: ClassVar = []

    def __enter__(self):
        self.said.append("entered")
        return self

    def __exit__(self, *_):
        self.said.append("left")


class NoPolicy:
    environment = MappingProxyType({})
