"""The middle line of a tube as an output: where the tube is, how wide open, shut and parted."""

from __future__ import annotations

import numpy as np

from engines.fem.blood.lumen import Lumen
from hub.participant import signal_out
from schemas.ports import Port
from schemas.ros import Header, Time
from schemas.trocar_msgs import TubeLine

__all__ = ["line_port", "tube_line"]


def line_port(organ: str, period_ns: int) -> Port:
    """Return the port of the middle line of an organ with a lumen."""
    meaning = "middle line of the lumen from its left end, with the open cross-section of every ring"
    return signal_out(f"{organ}/line", TubeLine, meaning, frame="world", period_ns=period_ns)


def tube_line(body: str, lumen: Lumen, t: int) -> TubeLine:
    """Return the middle line at `t` ns."""
    parted = np.zeros(len(lumen.along), np.uint8)
    parted[[parting.ring for parting in lumen.partings]] = 1
    return TubeLine(
        header=Header(stamp=Time.from_ns(t), frame_id="world"),
        body=body,
        points_m=lumen.middles.ravel(),
        along_m=lumen.along,
        areas_m2=lumen.open_areas,
        diameters_m=lumen.diameters,
        shut=lumen.shut.astype(np.uint8),
        parted=parted,
    )
