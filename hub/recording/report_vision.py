"""The part of a report about controllers with a camera: paths of features, and the camera's velocity."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from hub.recording.recording import Recording
from hub.recording.report_canvas import INK, SERIES, Figure, axes_of, draw_legend, thin
from schemas.vectors import Vector

__all__ = ["vision_figures"]

_SHOWN = 3
"""Standard deviations of a band."""


def vision_figures(recording: Recording) -> Iterator[Figure]:
    """Yield the figures of every participant with ports of these names.

    `features` and `features_goal` (x and y of points, px) give their paths in the picture and their distances
    from the goal, `camera_velocity` the velocity, `pose_error` and `pose_deviation` (position in m, rotation
    vector in rad) the error of an estimate within the estimator's bounds.
    """
    for port in recording.ports:
        name, _, kind = port.partition(".")
        if kind == "features" and f"{name}.features_goal" in recording:
            yield from _feature_figures(recording, name)
        elif kind == "camera_velocity":
            yield from _velocity_figure(recording, name)
        elif kind == "pose_error" and f"{name}.pose_deviation" in recording:
            yield from _error_figures(recording, name)


def _feature_figures(recording: Recording, name: str) -> Iterator[Figure]:
    measured, wanted = recording[f"{name}.features"], recording[f"{name}.features_goal"]
    count = min(len(measured.time), len(wanted.time))
    seen = measured.values[:count].any(axis=1)
    if not seen.any():
        return
    time = measured.time[:count][seen]
    path = measured.values[:count][seen].reshape(len(time), -1, 2)  # (n, points, 2)
    goal = wanted.values[:count][seen].reshape(path.shape)
    with axes_of("x (px)", "y (px)") as (axes, result):
        for i in range(path.shape[1]):
            axes.plot(*path[:, i].T, color=SERIES[i % len(SERIES)], label=f"point {i}")
            axes.plot(*path[0, i], color=SERIES[i % len(SERIES)], marker="o", markersize=4)
            axes.plot(*goal[-1, i], color=INK, marker="+", markersize=9, linestyle="")
        axes.set_aspect("equal", adjustable="datalim")
        axes.invert_yaxis()
        draw_legend(axes)
    caption = "Paths of the features in the picture, from the dots; where they should be: crosses."
    yield Figure(f"{name}: features", result.svg(caption), caption)
    away = np.linalg.norm(path - goal, axis=2)
    with axes_of("time (s)", "distance from the goal (px)") as (axes, result):
        for i in range(path.shape[1]):
            line = thin(time, np.maximum(away[:, i], 1e-3))
            axes.plot(*line, color=SERIES[i % len(SERIES)], label=f"point {i}")
        axes.set_yscale("log")
        axes.axhline(1.0, color=INK, linestyle=":", linewidth=1)
        draw_legend(axes)
    caption = f"Distance of each feature from its place. At the end {away[-1].max():.2g} px at most."
    yield Figure(f"{name}: feature error", result.svg(caption), caption)


def _velocity_figure(recording: Recording, name: str) -> Iterator[Figure]:
    series = recording[f"{name}.camera_velocity"]
    blocks = (("linear", "velocity (mm/s)", 1e3), ("angular", "angular velocity (rad/s)", 1.0))
    for block, label, scale in blocks:
        values = series[block] * scale
        with axes_of("time (s)", label) as (axes, result):
            _vector_components(axes, series.time, values)
        peak = float(np.linalg.norm(values, axis=1).max(initial=0.0))
        caption = f"In the camera's own frame ({series.frame}): x right, y down, z ahead. At most {peak:.3g}."
        yield Figure(f"{name}: camera, {label.partition(' (')[0]}", result.svg(caption), caption)


def _vector_components(axes: Any, time: Vector, values: Vector) -> None:
    for i, axis in enumerate("xyz"):
        axes.plot(*thin(time, values[:, i]), color=SERIES[i], label=axis)
    draw_legend(axes)


def _error_figures(recording: Recording, name: str) -> Iterator[Figure]:
    error, deviation = recording[f"{name}.pose_error"], recording[f"{name}.pose_deviation"]
    count = min(len(error.time), len(deviation.time))
    time = error.time[:count]
    for first, label, scale in ((0, "position (mm)", 1e3), (3, "rotation (degree)", np.degrees(1.0))):
        values = error.values[:count, first : first + 3] * scale
        bounds = _SHOWN * deviation.values[:count, first : first + 3] * scale
        with axes_of("time (s)", f"error of {label}") as (axes, result):
            for i, axis in enumerate("xyz"):
                axes.plot(*thin(time, values[:, i]), color=SERIES[i], label=axis, linewidth=1)
                for side in (-1.0, 1.0):
                    axes.plot(*thin(time, side * bounds[:, i]), color=SERIES[i], linewidth=0.7, linestyle=":")
            limit = 1.5 * float(np.percentile(np.abs(np.hstack([values, bounds])), 99))
            axes.set_ylim(-limit, limit)
            draw_legend(axes)
        inside = float(np.mean(np.abs(values) <= bounds))
        caption = (
            "Error of the estimate along the axes of the object's own frame; dotted: three standard"
            f" deviations as the estimate states them. {inside:.1%} of the errors are within."
        )
        yield Figure(f"{name}: {label.partition(' (')[0]}", result.svg(caption), caption)
