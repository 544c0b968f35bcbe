"""What `bench/soak.py` has sampled: trends, verdict and plot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

__all__ = ["COLUMNS", "SESSION_COLUMNS", "Sample", "SessionSample", "plotted", "report", "slope"]

LARGEST_SLOPE = 1.0
"""Growth of memory that is a leak, MB/h."""
SHARE = 0.2
"""Of the samples: files and threads grow if the last fifth never goes down to the most of the first."""


class Sample(NamedTuple):
    """One process at one time."""

    seconds: float
    process: str
    pid: int
    rss_mb: float
    files: int
    threads: int


class SessionSample(NamedTuple):
    """What the session reports at one time; latencies are the p99 of the slowest stream since the start."""

    seconds: float
    simulated_s: float
    steps: int
    late_steps: int
    dropped: int
    device_to_grant_p99_ms: float
    grant_to_state_p99_ms: float
    state_to_force_p99_ms: float


COLUMNS, SESSION_COLUMNS = Sample._fields, SessionSample._fields


def slope(x: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """Return the slope of a least-squares line and its standard error; NaN with fewer than three points."""
    if len(x) < 3:
        return float("nan"), float("nan")
    from_mean = np.asarray(x) - np.mean(x)
    spread = float(np.sum(from_mean**2))
    rise = float(from_mean @ np.asarray(y)) / spread
    rest = np.asarray(y) - np.mean(y) - rise * from_mean
    return rise, float(np.sqrt(np.sum(rest**2) / (len(x) - 2) / spread))


def report(
    samples: Sequence[Sample], session: Sequence[SessionSample], settle_s: float
) -> tuple[list[str], bool]:
    """Return the lines about what comes after `settle_s`, and whether something grows."""
    lines = [f"{'process':<32}{'RSS, MB':>18}{'MB/h':>17}{'files':>11}{'threads':>11}"]
    grows = False
    for pid, name in dict.fromkeys((sample.pid, sample.process) for sample in samples):
        rows = [sample for sample in samples if sample.pid == pid and sample.seconds >= settle_s]
        if len(rows) < 3:
            continue
        rise, error = slope([row.seconds / 3600 for row in rows], [row.rss_mb for row in rows])
        found = [f"{rise:.2f} ± {error:.2f} MB/h"] if rise >= LARGEST_SLOPE and rise > 2 * error else []
        found += [what for what in ("files", "threads") if _grows([getattr(row, what) for row in rows])]
        lines.append(
            f"{name[:31]:<32}{rows[0].rss_mb:>8.1f} → {rows[-1].rss_mb:<7.1f}{rise:>8.2f} ± {error:<6.2f}"
            f"{rows[0].files:>5} → {rows[-1].files:<3}{rows[0].threads:>5} → {rows[-1].threads:<3}"
            f"{'  GROWS: ' + ', '.join(found) if found else ''}"
        )
        grows = grows or bool(found)
    return [*lines, *_pace([row for row in session if row.seconds >= settle_s])], grows


def _grows(counts: Sequence[int]) -> bool:
    part = max(1, round(SHARE * len(counts)))
    return min(counts[-part:]) > max(counts[:part])


def _pace(rows: Sequence[SessionSample]) -> list[str]:
    """Return lines about the pace of both halves, and about the latencies so far."""
    if len(rows) < 3:
        return ["too short for trends"]
    middle, lines = len(rows) // 2, list[str]()
    for name, first, last in (("first half", rows[0], rows[middle]), ("second half", rows[middle], rows[-1])):
        seconds = last.seconds - first.seconds
        late = (last.late_steps - first.late_steps) / (seconds / 60)
        factor = (last.simulated_s - first.simulated_s) / seconds
        lines.append(f"{name}: {late:.1f} late steps per minute, real-time factor {factor:.4f}")
    last = rows[-1]
    lines.append(f"dropped messages: {rows[0].dropped} → {last.dropped}")
    for field in SESSION_COLUMNS[5:]:
        lines.append(f"{field}: {getattr(rows[0], field):.2f} → {getattr(last, field):.2f}")
    return lines


def plotted(samples: Sequence[Sample], session: Sequence[SessionSample], file: Path) -> None:
    """Write the plot: memory, files and threads of each process, late steps."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(4, 1, figsize=(9, 12), sharex=True, layout="constrained")
    for pid, name in dict.fromkeys((sample.pid, sample.process) for sample in samples):
        rows = [sample for sample in samples if sample.pid == pid]
        minutes = [row.seconds / 60 for row in rows]
        for axis, what in zip(axes, ("rss_mb", "files", "threads"), strict=False):
            axis.plot(minutes, [getattr(row, what) for row in rows], label=name)
    axes[3].plot([row.seconds / 60 for row in session], [row.late_steps for row in session])
    for axis, label in zip(axes, ("RSS, MB", "open files", "threads", "late steps"), strict=True):
        axis.set_ylabel(label)
        axis.set_ylim(bottom=0)
    axes[0].legend(fontsize="small")
    axes[3].set_xlabel("minutes")
    figure.savefig(file)
    plt.close(figure)
