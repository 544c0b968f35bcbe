"""The part of a report about tissue: needles in tissue, and tissue that was cut, torn and burnt."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hub.recording.recording import Recording
from hub.recording.report_canvas import Figure, axes_of, draw_legend, line_of, thin
from schemas.readable import counted
from schemas.trocar_msgs import TissueEvent

__all__ = ["tissue_figures"]

_SHOWN = {"m^2": (1e6, "mm²"), "m^3": (1e9, "mm³")}
"""Factor and name of the unit of a sum, by the unit of events."""
_LINES = 8
"""Number of insertions drawn: more would look the same."""


def tissue_figures(recording: Recording) -> Iterator[Figure]:
    """Yield the figures of every participant with ports of these names.

    `insertion` (m) and `tip_force` (N) give the tip force over depth, a line for each insertion; `trauma`
    (m^2) the area between needle and channel. Events of tissue give their sum over time.
    """
    for port, type_ in recording.ports.items():
        if type_ == TissueEvent.ros_type:
            yield from _event_figures(recording, port)
        name, _, kind = port.partition(".")
        if kind == "trauma" and {f"{name}.insertion", f"{name}.tip_force"} <= set(recording.ports):
            yield from _force(recording, name)
            yield from _trauma_figure(recording, name)


def _force(recording: Recording, name: str) -> Iterator[Figure]:
    insertion, force = recording[f"{name}.insertion"], recording[f"{name}.tip_force"]
    count = min(len(insertion.time), len(force.time))
    way, pushed = insertion.values[:count].ravel(), force.values[:count].ravel()
    # an insertion begins where the tip touches and ends where the needle is out
    is_there = np.concatenate([[False], (way > 0.0) | (pushed > 0.0), [False]])
    starts, ends = np.flatnonzero(np.diff(is_there.astype(int))).reshape(-1, 2).T
    through = [span for span in zip(starts, ends, strict=True) if way[span[0] : span[1]].any()]
    if not through:
        return
    with axes_of("way of the tip since the skin (mm)", "force on the tip (N)") as (axes, result):
        for i, (start, end) in enumerate(through[:_LINES]):
            line = thin(np.arange(float(end - start)), pushed[start:end])
            at = line[0].astype(int)
            axes.plot(way[start:end][at] * 1e3, line[1], label=f"{i + 1}", **line_of(i))
        draw_legend(axes)
    caption = (
        f"Force of skin and tissue on the tip alone, {counted(len(through), 'time')} in: it breaks through"
        f" the skin, cuts, and breaks out again. At most {pushed.max():.3g} N."
    )
    yield Figure(f"{name}: force on the tip", result.svg(caption), caption)


def _trauma_figure(recording: Recording, name: str) -> Iterator[Figure]:
    series = recording[f"{name}.trauma"]
    area = series.values.ravel() * 1e6
    if not area.any():
        return
    with axes_of("time (s)", "swept area (mm²)") as (axes, result):
        axes.plot(*thin(series.time, area), **line_of(0))
    caption = f"Area between needle and channel: the tissue pushed aside. At most {area.max():.3g} mm²."
    yield Figure(f"{name}: trauma", result.svg(caption), caption)


def _event_figures(recording: Recording, port: str) -> Iterator[Figure]:
    """Yield the sums of an organ's events over time, a figure for each unit, a line for each kind."""
    events = [(t, one) for t, one in recording[port].messages() if isinstance(one, TissueEvent)]
    for unit in dict.fromkeys(one.unit for _, one in events):
        factor, name = _SHOWN.get(unit, (1.0, unit))
        kinds, sums = list(dict.fromkeys(one.kind for _, one in events if one.unit == unit)), list[str]()
        with axes_of("time (s)", f"sum ({name})") as (axes, result):
            for i, kind in enumerate(kinds):
                own = [(t, one.size * factor) for t, one in events if (one.kind, one.unit) == (kind, unit)]
                times, sizes = np.transpose(own)
                total = np.cumsum(sizes)
                axes.plot(times, total, drawstyle="steps-post", marker=".", label=kind, **line_of(i))
                sums.append(f"{total[-1]:.3g} {name} {kind}, {counted(len(own), 'time')}")
            draw_legend(axes)
        caption = "; ".join(sums) + "."
        yield Figure(f"{port.removesuffix('/events')}: {', '.join(kinds)}", result.svg(caption), caption)
