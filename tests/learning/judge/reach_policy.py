"""Policies behind a contract: a tip that goes to a place and stays, and one that answers nonsense."""

import numpy as np

GOAL = np.array([0.0, 0.0, 0.04])


class Reach:
    """Goes to the middle of the workspace, in the world's frame, 20 mm/s."""

    metadata = {"contract": {"action_layout": "open-h-dvrk", "state": 8, "action": 8}}  # noqa: RUF012

    def __init__(self, contract):
        self.rate, self.asked = contract["rate"], 0

    def act(self, observation):
        """Return ten rows towards the goal."""
        state = observation["state"].astype(float)
        way = GOAL - state[:3]
        speed = 0.06 / self.rate
        self.asked += 1
        shares = np.minimum(1.0, speed * np.arange(1, 11) / max(np.linalg.norm(way), 1e-9))
        return [[*(state[:3] + share * way), *state[3:]] for share in shares]


class Lost(Reach):
    """Has no answer the second time."""

    def act(self, observation):
        """Return NaN, later."""
        rows = np.array(super().act(observation))
        return rows * np.nan if self.asked > 1 else rows
