"""Policies for tests, in a child process."""

import os
import sys
import time

import numpy as np


class Still:
    """Stays where it is; prints, which must not disturb the answers."""

    def __init__(self, contract):
        self.rows, self.resets = contract["horizon"], []

    def reset(self, episode):
        self.resets.append(episode)

    def act(self, observation):
        print("a line on the standard output")  # noqa: T201
        return np.tile(observation["state"], (self.rows, 1))


class Claims(Still):
    metadata = {"contract": {"horizon": 99, "action": 20}}  # noqa: RUF012


def text(observation):
    return "go left"


def not_a_number(observation):
    return np.full((1, 8), np.nan)


def too_wide(observation):
    return np.zeros((1, 9))


def huge(observation):
    return np.zeros((1, 2**27))


def raises(observation):
    raise RuntimeError("no plan")


def dies(observation):
    os._exit(3)


def slow(observation):
    time.sleep(60.0)


def speaks_otherwise(observation):
    os.write(int(sys.argv[1]) if len(sys.argv) > 1 else 1, b"hello")


def recovers(observation):
    """Die once, at the second question of the first process."""
    if observation["number"] == 2:
        os._exit(4)
    return observation["state"]
