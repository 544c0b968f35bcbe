"""A policy for the scenario `policy`: the needle is picked up, led by the arm's state alone.

Layout `open-h-dvrk`: eight numbers in, rows of eight numbers out. For a policy of your own see
docs/how-to/policies.md.
"""

import numpy as np

ALONG_X = [0.70710678, 0.70710678, 0.0, 0.0]
"""Orientation with the jaws down, opening along x: quaternion (x, y, z, w)."""
OPEN, SHUT = np.radians(30.0), np.radians(-20.0)
WAYPOINTS = [(-0.170, OPEN), (-0.1895, OPEN), (-0.1895, SHUT), (-0.1495, SHUT)]
"""Height of the tip under the arm's base (m), and opening of the jaw (rad)."""
ROW_S, SPEED = 1.0 / 30.0, 0.08
"""Time from row to row, s, and speed of the tip, m/s."""


class Pick:
    """Goes from waypoint to waypoint."""

    metadata = {"contract": {"action_layout": "open-h-dvrk", "action": 8, "state": 8, "rate": 30.0}}  # noqa: RUF012

    def __init__(self, contract):
        self.rows = contract["horizon"]
        self.reset(0)

    def reset(self, episode):  # noqa: ARG002
        """Begin at the first waypoint."""
        self.at = 0

    def act(self, observation):
        """Return rows from the measured pose towards the present waypoint."""
        state = observation["state"].astype(float)
        position, jaw = state[:3], state[7]
        height, opening = WAYPOINTS[self.at]
        goal = np.array([0.0, 0.0, height])
        turned = jaw > 0.9 * opening if opening > 0.0 else jaw < 0.2  # the needle is between the jaws
        if np.linalg.norm(goal - position) < 1.5e-3 and turned and self.at < len(WAYPOINTS) - 1:
            self.at += 1
        rows = []
        for row in range(1, self.rows + 1):
            way = goal - position
            share = min(1.0, row * ROW_S * SPEED / max(np.linalg.norm(way), 1e-9))
            rows.append([*(position + share * way), *ALONG_X, opening])
        return rows
