"""The plots of a report about bonds and steps."""

from __future__ import annotations

import numpy as np

from hub.recording.bond_trace import CONTACT_SHARE, BondTrace
from hub.recording.report_canvas import INK, SERIES, Figure, axes_of, draw_legend, line_of, thin
from schemas.readable import counted
from schemas.vectors import Vector

__all__ = [
    "energy_figures",
    "force_figure",
    "motion_figure",
    "pace_figure",
    "press_figure",
    "step_time_figures",
]

_POINTS = 1200
"""Points of a line."""


def press_figure(trace: BondTrace) -> Figure:
    """Force against depth, a line per contact."""
    contacts = trace.contacts
    with axes_of("depth (mm)", "force (N)") as (axes, result):
        for i, contact in enumerate(contacts):
            line = contact.thin(_POINTS)
            axes.plot(
                line.depth * 1e3,
                line.force,
                linewidth=1,
                color=SERIES[i % len(SERIES)],
                label=f"{line.times_s[0]:.1f}–{line.times_s[-1]:.1f} s"
                if len(contacts) <= len(SERIES)
                else None,
            )
        if 1 <= len(contacts) <= len(SERIES):
            draw_legend(axes)
        axes.set_ylim(bottom=0)
    deepest_mm = 1e3 * max((float(one.depth.max()) for one in contacts), default=0.0)
    caption = (
        "Depth is the displacement of the motion side since the touch, against the force until half of the"
        f" contact's largest; contact is where the force exceeds {CONTACT_SHARE:.0%} of its peak of"
        f" {trace.peak:.3g} N. {counted(len(contacts), 'contact')},"
        f" deepest {deepest_mm:.2f} mm."
    )
    return Figure(f"{trace.name}: force against depth", result.svg(caption), caption)


def force_figure(trace: BondTrace) -> Figure:
    """Force over time, by component."""
    with axes_of("time (s)", "force (N)") as (axes, result):
        axes.plot(
            *thin(trace.times_s, trace.magnitude), color=INK, alpha=0.3, linewidth=3.5, label="magnitude"
        )
        for i, name in zip(range(trace.force.shape[1]), "xyz", strict=False):
            axes.plot(*thin(trace.times_s, trace.force[:, i]), color=SERIES[i], label=name)
        draw_legend(axes)
    caption = f"Force on the motion side, in the bond's frame. Peak {trace.peak:.3g} N."
    return Figure(f"{trace.name}: force", result.svg(caption), caption)


def motion_figure(trace: BondTrace) -> Figure:
    """Position over time, from the start position."""
    moved_mm = (trace.position - trace.position[:1]) * 1e3
    with axes_of("time (s)", "displacement (mm)") as (axes, result):
        for i, name in zip(range(moved_mm.shape[1]), "xyz", strict=False):
            axes.plot(*thin(trace.times_s, moved_mm[:, i]), color=SERIES[i], label=name)
        draw_legend(axes)
    caption = (
        "Displacement of the motion side from its start, in the bond's frame. Largest"
        f" {np.abs(moved_mm).max(initial=0):.3g} mm."
    )
    return Figure(f"{trace.name}: motion", result.svg(caption), caption)


def energy_figures(bond: str, times_s: Vector, motion_j: Vector, force_j: Vector) -> list[Figure]:
    """The energy book of a bond: works (J since the start), and energy created or lost by the coupling."""
    residual_uj = (force_j - motion_j) * 1e6
    with axes_of("time (s)", "work (mJ)") as (axes, book):
        for i, (label, values, style) in enumerate(
            (("motion side", motion_j, "-"), ("force side", force_j, "--"))
        ):
            axes.plot(*thin(times_s, values * 1e3), color=SERIES[i], linestyle=style, label=label)
        draw_legend(axes)
    with axes_of("time (s)", "residual (µJ)") as (axes, residual):
        axes.plot(*thin(times_s, residual_uj), color=SERIES[2])
        axes.axhline(0.0, color=INK, linestyle=":", linewidth=1)
    largest_uj = 1e6 * max(np.abs(motion_j).max(), np.abs(force_j).max())
    book_caption = (
        "Work that the motion side gave and the force side took, since the start. Largest"
        f" {largest_uj * 1e-3:.3g} mJ."
    )
    share = f", {abs(residual_uj[-1]) / largest_uj:.2g} of the largest work" if largest_uj else ""
    caption = (
        "Energy that the coupling created (positive) or lost: work taken less work given. At the end"
        f" {residual_uj[-1]:.3g} µJ{share}."
    )
    return [
        Figure(f"{bond}: energy book", book.svg(book_caption), book_caption),
        Figure(f"{bond}: energy residual", residual.svg(caption), caption),
    ]


def step_time_figures(compute: dict[str, tuple[Vector, Vector]], step_s: float) -> list[Figure]:
    """Compute times per step, as a distribution and over time.

    `compute`: for each participant, the times (s) of the steps and the compute times (s), shape (n,).
    """
    caption = "Time a participant computes per step of its own, by the wall clock. " + "; ".join(
        f"{name}: median {np.median(spent) * 1e6:.0f} µs, 99 % below {np.percentile(spent, 99) * 1e6:.0f} µs"
        for name, (_, spent) in compute.items()
    )
    low = max(1e-9, min(float(spent.min()) for _, spent in compute.values())) * 1e6
    high = max(float(spent.max()) for _, spent in compute.values()) * 1e6
    bins = np.geomspace(low, max(high, 1.1 * low) * 1.001, 60)
    with axes_of("compute time per step (µs)", "share of steps (%)") as (axes, spread):
        for i, (name, (_, spent)) in enumerate(compute.items()):
            share = np.histogram(spent * 1e6, bins)[0] * (100.0 / len(spent))
            axes.stairs(share, bins, label=name, linewidth=1.4, **line_of(i))
        axes.set_xscale("log")
        axes.axvline(step_s * 1e6, color=INK, linestyle=":", linewidth=1, label="communication step")
        draw_legend(axes)
    over = "Median (line) and 99th percentile (thin line) of the compute time, in intervals of the session."
    with axes_of("time (s)", "compute time per step (µs)") as (axes, over_time):
        for i, (name, (times, spent)) in enumerate(compute.items()):
            parts = np.array_split(np.arange(len(times)), min(len(times), 120))
            middle = [float(times[part].mean()) for part in parts]
            for percentile, width in ((50, 1.4), (99, 0.6)):
                line = [float(np.percentile(spent[part], percentile)) * 1e6 for part in parts]
                axes.plot(
                    middle,
                    line,
                    **line_of(i),
                    linewidth=width,
                    label=name if percentile == 50 else None,
                )
        axes.set_yscale("log")
        draw_legend(axes)
    return [
        Figure("Compute time per step", spread.svg(caption), caption + "."),
        Figure("Compute time over the session", over_time.svg(over), over),
    ]


def pace_figure(times_s: Vector, factor: Vector) -> Figure:
    """Real-time factor over simulated time."""
    with axes_of("time (s)", "real-time factor") as (axes, result):
        axes.plot(*thin(times_s, factor), color=SERIES[0])
        axes.axhline(1.0, color=INK, linestyle=":", linewidth=1)
        axes.set_ylim(bottom=0)
    caption = (
        "Simulated seconds per wall second, as the session stated it; 1 is real time. Median"
        f" {np.median(factor):.2f}."
    )
    return Figure("Pace", result.svg(caption), caption)
