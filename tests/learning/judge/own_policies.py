"""Policies of a stranger: one that gives no numbers, and one that is no policy."""

import numpy as np


class Failing:
    images = False

    def begin(self, env, seed):
        self.left, self.shape, self.seed = 3, env.action_space.shape, seed

    def act(self, observation):
        self.left -= 1
        return np.full(self.shape, 0.0 if self.left or self.seed else np.nan)


class NoPolicy:
    images = False
