"""Organs that touch one another and themselves: they advance side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from engines.fem.attachments.attachments import Attachments
from engines.fem.organ import Organ, still_way
from schemas.vectors import Vector

__all__ = ["Together"]

_AHEAD, _SKIN = 0.1, 0.2
"""Distance of a vertex from a face that it meets, on both sides, and the skin of `_pairs.c`, over the least
mean edge of the surfaces.
"""


class Together:
    """Organs in one call of `_together.c` a step."""

    def __init__(self, organs: Sequence[Organ]) -> None:
        from engines.fem._solid import Together as Compiled

        self._organs = organs
        self.forces: Vector = np.zeros((len(organs), 3))
        """Mean force of all contacts on each organ in the last step, N, shape (n, 3)."""
        edge = min(organ.mean_edge for organ in organs)
        self._compiled = Compiled(
            tuple(organ.solid.compiled for organ in organs),
            np.array([organ.solid.middle for organ in organs]),
            np.array([organ.friction for organ in organs]),
            self.forces,
            _AHEAD * edge,
            _SKIN * edge,
        )
        self._step = 0.0, 0.0
        """Length of a step, s, and gravity, m/s^2, for which `_arguments` are."""
        self._arguments: tuple[tuple[Any, ...], ...] = ()

    def attach(self, attachments: Attachments) -> None:
        """Let the organs hang together."""
        self._compiled.attach(
            attachments.place, attachments.rest, attachments.law, attachments.widest, attachments.force
        )

    def settle(self, gravity: float, plan: Callable[[float], int]) -> None:
        """Let the organs come to rest under their weight (m/s^2, along -z).

        plan: sets the sub-steps of all organs in a time (s) and returns their number.
        """
        seconds = max(organ.settling_s for organ in self._organs)
        if not seconds:
            return
        way = still_way(plan(seconds))
        self._compiled.advance(
            tuple(
                organ.solid.arguments(
                    seconds, way, way.no_forces(), 0.0, gravity, organ.settling_drag, organ.every
                )
                for organ in self._organs
            )
        )
        for organ in self._organs:
            organ.stand()

    def advance(self, seconds: float, gravity: float) -> None:
        """Advance; the organs have the forces on the spheres."""
        if self._step != (seconds, gravity):
            self._step = seconds, gravity
            self._arguments = tuple(organ.arguments(seconds, gravity) for organ in self._organs)
        if self._compiled.advance(self._arguments):
            for organ in self._organs:
                organ.follow_surface()

    def forget(self) -> None:
        """Search pairs anew: the organs have been restored."""
        self._compiled.forget()
