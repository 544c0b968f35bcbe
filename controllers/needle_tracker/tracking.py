"""Following a needle from picture to picture: when the filter is believed, and how a slip is found.

What a picture shows may be the needle where it is expected, the needle elsewhere (it has slipped), or not the
needle (it is covered; something else has its colour). The second differs from the others by wire or tip that
is seen but not explained. After two such pictures in a row the needle is searched for: as it may have turned
about the point where it is held, the prior is loosened by such turns, and the estimate iterated from several
of them. Among the starts is the mirror image, since an arc seen by one eye may be tilted towards it or away.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from controllers.needle_tracker.arc_fit import Arc
from controllers.needle_tracker.filter import Estimate, NeedleView, Update, predict_estimate, update_estimate
from controllers.needle_tracker.noise import Noise
from controllers.needle_tracker.pose import move_pose, pose_error, turned_about
from robots.transform import rigid_transform
from schemas.vectors import Vector

__all__ = ["NeedleBelief", "TrackerSettings", "follow_needle", "mirror_pose"]

_GATE = 4.0
_INNOVATION = 6.0
"""Mean squared innovation (in variances) from which on a picture does not fit."""
_LEAST, _MOST = 0.35, 0.3
"""Share of the wire that must be seen in its place, unless less than the other share is seen elsewhere."""
_SUSPECT = 2
"""Pictures in a row that do not fit until the needle is searched for."""
_SLIPPED = 0.06
"""rad by which a needle doubted must have turned to be said to have slipped."""
_DOUBT = 0.02
"""Share of a slip's variance that a picture which does not fit adds."""
_AGAIN = 8
"""Pictures from a search in vain to the next one."""
_FOUND = 0.35
"""Share of the wire that a search must explain."""
_FITS = 9.0
"""Mean squared residual (in variances) beyond which a search has found nothing: other wire pulls at it."""
_TURNS = (-0.45, -0.2, 0.2, 0.45)
"""rad about each axis of the needle, from which a search starts."""
_TIP = 0.5
"""What the tip in its place is worth, as a share of the wire."""
_DEPARTURE, _MISFIT = 0.02, 0.02
"""What a unit of distance from the prior takes away, and one of the mean misfit, as shares of the wire."""


@dataclass(frozen=True)
class TrackerSettings:
    """What the tracker assumes."""

    noise: Noise = field(default_factory=Noise)
    drift: tuple[float, float] = (0.2e-3, 0.01)
    """How far a held needle moves in the gripper, and is turned, in a second: standard deviations, m, rad."""
    slip: tuple[float, float] = (2e-3, 0.35)
    """Slip: displacement and turn about the holding point, standard deviations, m, rad."""


@dataclass(frozen=True)
class NeedleBelief:
    """What is known of the needle."""

    estimate: Estimate
    doubts: int = -1
    """Pictures in a row that did not fit; -1: it was never seen."""
    seen: bool = False
    """Whether the newest picture showed it."""
    slipped: bool = False
    """Whether it has just been found elsewhere."""
    share: float = 0.0
    """Share of the wire in its place in the newest picture."""


def follow_needle(
    arc: Arc, belief: NeedleBelief, views: Sequence[NeedleView], seconds: float, settings: TrackerSettings
) -> NeedleBelief:
    """Return what is known `seconds` later, after what `views` show; none are no picture."""
    prior = predict_estimate(belief.estimate, seconds, settings.drift)
    if not any(len(view.seen.points) for view in views):
        return replace(belief, estimate=prior, seen=False, slipped=False)
    update = update_estimate(arc, prior, views, settings.noise, _GATE)
    doubts = belief.doubts + 1 if belief.doubts >= 0 else _SUSPECT
    if _is_doubtful(update):
        if doubts < _SUSPECT or (doubts - _SUSPECT) % _AGAIN:
            # neither believed nor forgotten: the kinematics go on, a little less sure
            return NeedleBelief(
                _loosen_prior(prior, _holding_point(arc, prior.pose), settings.slip, _DOUBT), doubts
            )
        found = _search_needle(arc, prior, views, settings)
        if found is None:
            believed = update.explained >= _LEAST and update.misfit < _FITS
            return NeedleBelief(update.estimate if believed else prior, doubts)
        update = found
    # while it was doubted, the estimate stood still: it is where the needle was before
    turn = np.linalg.norm(pose_error(prior.pose, update.estimate.pose)[3:])
    slipped = belief.doubts > 0 and bool(turn > _SLIPPED)
    return NeedleBelief(update.estimate, 0, update.explained > 0.0, slipped, update.explained)


def _is_doubtful(update: Update) -> bool:
    missing = update.explained < _LEAST and update.unexplained > _MOST
    return missing or update.tip_refused or update.innovation > _INNOVATION


def _search_needle(
    arc: Arc, prior: Estimate, views: Sequence[NeedleView], settings: TrackerSettings
) -> Update | None:
    """Return the best of several searches; None if none is better than to go on as before."""
    held = _holding_point(arc, prior.pose)
    loose = _loosen_prior(prior, held, settings.slip)
    trials = [update_estimate(arc, prior, views, settings.noise, _GATE, prior.pose)]
    trials += [
        update_estimate(arc, loose, views, settings.noise, _GATE, start)
        for start in _starts(prior.pose, held, views)
    ]
    best = max(trials, key=_score_estimate)
    usual = _score_estimate(update_estimate(arc, prior, views, settings.noise, _GATE))
    fits = best.explained > _FOUND and best.misfit < _FITS
    return best if fits and _score_estimate(best) > usual else None


def _score_estimate(update: Update) -> float:
    """Return how much speaks for an estimate, as a share of the wire."""
    against = _DEPARTURE * update.departure + _MISFIT * min(update.misfit, 25.0)
    return update.explained + (_TIP if update.tip else 0.0) - against


def _holding_point(arc: Arc, pose: Vector) -> Vector:
    """Return the point of the wire nearest to the middle of the gripper, in the needle's frame, (3,), m."""
    in_gripper = arc.points @ pose[:3, :3].T + pose[:3, 3]
    return arc.points[int((in_gripper**2).sum(axis=1).argmin())]


def _loosen_prior(prior: Estimate, held: Vector, slip: tuple[float, float], share: float = 1.0) -> Estimate:
    """Return the prior as it is after a slip of `share` of the variance."""
    turns = slip[1] * turned_about(held)
    covariance = prior.covariance + share * (turns @ turns.T)
    covariance[:3, :3] += share * slip[0] ** 2 * np.eye(3)
    return Estimate(prior.pose, covariance)


def _starts(pose: Vector, held: Vector, views: Sequence[NeedleView]) -> Iterator[Vector]:
    yield pose
    yield mirror_pose(pose, views[0].projection)
    turns = turned_about(held)
    for axis in range(3):
        for angle in _TURNS:
            turn = move_pose(np.eye(4), angle * turns[:, axis])[:3, :3]
            yield pose @ rigid_transform(turn, held - turn @ held)


def mirror_pose(pose: Vector, projection: Vector) -> Vector:
    """Return the other pose, shape (4, 4), of which an eye sees about the same arc with the same tip.

    The arc is mirrored in depth: at its centre across the line of sight.
    """
    eye = -np.linalg.solve(projection[:, :3], projection[:, 3])
    sight = pose[:3, 3] - eye
    sight = sight / np.linalg.norm(sight)
    result = pose.copy()
    result[:3, :3] = (np.eye(3) - 2.0 * np.outer(sight, sight)) @ pose[:3, :3] @ np.diag([1.0, 1.0, -1.0])
    return result
