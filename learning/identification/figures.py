"""The figure of a fit: predicted over measured efforts, before and after identification, by joint."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from robots.identification.fit import Fit

__all__ = ["write_figure"]

_INCHES, _INCHES_A_JOINT, _DPI = 10.0, 1.6, 120


def write_figure(file: Path, found: Fit, joints: Sequence[str]) -> None:
    """Write the efforts over time to `file`, in the suffix's format; held-back data is shaded."""
    figure = Figure(figsize=(_INCHES, _INCHES_A_JOINT * len(joints)), layout="constrained")
    FigureCanvasAgg(figure)
    unseen = found.time[found.test]
    for i, (joint, axes) in enumerate(
        zip(joints, figure.subplots(len(joints), sharex=True, squeeze=False)[:, 0], strict=True)
    ):
        axes.axvspan(unseen[0], unseen[-1], color="0.92", label="not seen by the fit")
        axes.plot(found.time, found.measured[:, i], color="0.6", lw=3.0, label="measured")
        axes.plot(found.time, found.published[:, i], color="tab:orange", lw=0.8, label="published parameters")
        axes.plot(found.time, found.predicted[:, i], color="tab:blue", lw=1.0, label="identified")
        axes.set_ylabel(f"{joint}, {'N' if joint == 'insertion' else 'N m'}")
    figure.axes[0].legend(loc="upper right", ncols=4, fontsize="small")  # pyright: ignore[reportUnknownMemberType]
    figure.axes[-1].set_xlabel("time, s")  # pyright: ignore[reportUnknownMemberType]
    figure.savefig(file, dpi=_DPI)  # pyright: ignore[reportUnknownMemberType]
