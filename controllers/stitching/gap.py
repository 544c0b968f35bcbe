"""Least distance of two instruments while a needle is handed over. Metres, world."""

from __future__ import annotations

from itertools import product

import numpy as np

from controllers.expert.hand import RobotHand
from robots.dvrk.instruments import SHAFT_RADIUS
from schemas.vectors import Vector

__all__ = ["ROOM", "instrument_gap"]

ROOM = 2.0 * SHAFT_RADIUS + 1.6e-3
"""m: between the middles of two instruments, at least."""


def instrument_gap(one: RobotHand, tips: Vector, other: RobotHand, others: Vector) -> Vector:
    """Return the least distance of two instruments, shape (n,), with tips at poses of shape (n, 4, 4).

    An instrument is two lines: from the remote centre to the wrist, and on to the ends of the fingers.
    """
    pairs = product(_lines(one, tips), _lines(other, others))
    return np.min([_segment_distance(*a, *b) for a, b in pairs], axis=0)


def _lines(hand: RobotHand, tips: Vector) -> list[tuple[Vector, Vector]]:
    wrist = tips[:, :3, 3]
    centre = np.broadcast_to(hand.base[:3, 3], wrist.shape)
    return [(centre, wrist), (wrist, wrist + hand.jaw.length * tips[:, :3, 2])]


def _segment_distance(p: Vector, p_end: Vector, q: Vector, q_end: Vector) -> Vector:
    """Return the distance of segments, ends of shape (n, 3), as (n,).

    Source: Ericson, "Real-Time Collision Detection" (2005), section 5.1.9; no segment here is a point.
    """
    u, v, w = p_end - p, q_end - q, p - q
    a, b, e = (u * u).sum(axis=1), (u * v).sum(axis=1), (v * v).sum(axis=1)
    c, f = (u * w).sum(axis=1), (v * w).sum(axis=1)
    across = a * e - b * b
    parallel = across <= 1e-12 * a * e
    s = np.clip(np.where(parallel, 0.0, (b * f - c * e) / np.where(parallel, 1.0, across)), 0.0, 1.0)
    t = (b * s + f) / e
    s = np.where(t < 0.0, np.clip(-c / a, 0.0, 1.0), np.where(t > 1.0, np.clip((b - c) / a, 0.0, 1.0), s))
    off = w + s[:, None] * u - np.clip(t, 0.0, 1.0)[:, None] * v
    nearest: Vector = np.sqrt((off * off).sum(axis=1))
    return nearest
