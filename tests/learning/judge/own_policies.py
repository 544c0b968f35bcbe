"""Policies of a stranger: one that gives no numbers, and one that is no policy."""

from types import MappingProxyType

import numpy as np


class Failing:
    environment = MappingProxyType({})

    def begin(self, env, seed):
        self.left, self.shape, self.seed = 3, env.action_space.shape, seed

    def act(self, observation):
        self.left -= 1
        return np.full(self.shape, 0.0 if self.left or self.seed else np.nan)


class NoPolicy:
    environment = MappingProxyType({})
