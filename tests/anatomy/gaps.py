"""Gaps between the tubes of a patient, from the smooth lines of their organs."""

from itertools import combinations

import numpy as np

from engines.tissue.organs.centre_line import smooth_through

__all__ = ["JOINTS", "gaps_of"]

JOINTS = {
    ("cystic_duct", "gallbladder"): "left",
    ("cystic_duct", "common_bile_duct"): "right",
    ("cystic_artery", "gallbladder"): "left",
    ("cystic_artery", "hepatic_artery"): "right",
}
"""The end at which a tube meets an organ."""


def gaps_of(tubes, joint):
    """Least distance of the walls of each pair of tubes, m, without a length (m) at their joints."""
    swept = {name: _swept(tube) for name, tube in tubes.items()}
    return {pair: _gap(swept, *pair, joint) for pair in combinations(sorted(swept), 2)}


def _swept(tube):
    diameters = tube.diameters or (tube.diameter,) * len(tube.path)
    smooth = smooth_through(np.column_stack([tube.path, diameters]))
    return smooth[:, :3], 0.5 * smooth[:, 3]


def _gap(tubes, one, other, joint):
    for (own, organ), end in JOINTS.items():
        if {own, organ} == {one, other}:
            line, radii = tubes[own]
            along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
            free = (along if end == "left" else along[-1] - along) > joint
            return float(_beyond(line[free], radii[free], *tubes[organ]))
    return float(max(_beyond(*tubes[one], *tubes[other]), _beyond(*tubes[other], *tubes[one])))


def _beyond(points, own, line, radii):
    """Distance of balls of radii `own` from a tube with flat ends."""
    off = points[:, None] - line
    gaps = np.linalg.norm(off, axis=2) - radii
    rows, nearest = np.arange(len(points)), gaps.argmin(axis=1)
    found = gaps[rows, nearest]
    for end, inner in ((0, 1), (-1, -2)):
        way = (line[end] - line[inner]) / np.linalg.norm(line[end] - line[inner])
        arms = off[:, end]
        ahead = arms @ way
        aside = np.linalg.norm(arms - ahead[:, None] * way, axis=1)
        flat = np.hypot(np.maximum(aside - radii[end], 0.0), ahead)
        found = np.where((nearest == end % len(line)) & (ahead > 0.0), flat, found)
    return (found - own).min()
