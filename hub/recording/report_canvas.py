"""The canvas of a report's plots: SVG with the colours and the width of the page."""

from __future__ import annotations

import io
import re
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from schemas.errors import MissingExtraError
from schemas.vectors import Vector

__all__ = ["INK", "SERIES", "Canvas", "Figure", "axes_of", "draw_legend", "line_of", "thin"]

_POINTS = 1200
"""Points of a line; at the width of a page more make no difference."""

INK, _GRID = "#101112", "#d0d1d2"
SERIES = ("#c00001", "#c00002", "#c00003", "#c00004")
_VARIABLES = {
    INK: "var(--ink)",
    _GRID: "var(--grid)",
    **{colour: f"var(--series-{i})" for i, colour in enumerate(SERIES)},
}
"""Stand-ins for the page's own colours, light or dark with the reader's theme."""


@dataclass(frozen=True)
class Figure:
    """A plot of the page."""

    title: str
    svg: str
    caption: str


class Canvas:
    """The drawing."""

    text = ""

    def svg(self, label: str) -> str:
        """Return the SVG element, with `label` for readers without the picture."""
        body = self.text[self.text.index("<svg") :]
        body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
        for colour, variable in _VARIABLES.items():
            body = body.replace(colour, variable)
        return re.sub(
            r'<svg [^>]*?(viewBox="[^"]*")[^>]*>',
            rf'<svg \1 xmlns:xlink="http://www.w3.org/1999/xlink" role="img" aria-label="{escape(label)}">',
            body,
            count=1,
        )


@contextmanager
def axes_of(x: str, y: str) -> Generator[tuple[Any, Canvas]]:
    """Give axes to draw on; afterwards the result holds the SVG."""
    try:
        import matplotlib
        from matplotlib.figure import Figure as Sheet
    except ImportError as error:
        raise MissingExtraError("the report", "report", "matplotlib") from error
    mpl: Any = matplotlib
    settings = {
        "svg.fonttype": "none",
        "svg.hashsalt": "trocar",
        "font.family": "sans-serif",
        "font.size": 10,
        "text.color": INK,
        "axes.labelcolor": INK,
        "axes.edgecolor": INK,
        "axes.linewidth": 0.6,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "xtick.color": INK,
        "ytick.color": INK,
        "grid.color": _GRID,
        "grid.linewidth": 0.6,
        "lines.linewidth": 1.4,
        "lines.solid_joinstyle": "round",
    }
    result = Canvas()
    with mpl.rc_context(settings):
        figure: Any = Sheet(figsize=(4.8, 3.1), layout="constrained")
        axes = figure.add_subplot()
        axes.grid(visible=True)
        axes.set_axisbelow(True)
        axes.set_xlabel(x)
        axes.set_ylabel(y)
        yield axes, result
        stream = io.StringIO()
        figure.savefig(stream, format="svg", transparent=True, metadata={"Date": None})
    result.text = stream.getvalue()


def line_of(i: int) -> dict[str, str]:
    """Return colour and style of the line `i`; from the fifth on the colours come again, dashed, dotted."""
    return {"color": SERIES[i % len(SERIES)], "linestyle": ("-", "--", ":")[i // len(SERIES) % 3]}


def draw_legend(axes: Any) -> None:
    """Name the lines, above the plot."""
    axes.legend(
        frameon=False,
        fontsize=9,
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=4,
        borderaxespad=0,
        handlelength=1,
        columnspacing=1,
    )


def thin(x: Vector, y: Vector) -> Sequence[Vector]:
    """Leave out points of y over x too dense for a page, but keep the extremes of y."""
    if len(x) <= _POINTS:
        return x, y
    parts = np.array_split(np.arange(len(x)), _POINTS // 2)
    keep = np.unique([[part[np.argmin(y[part])], part[np.argmax(y[part])]] for part in parts])
    return x[keep], y[keep]
