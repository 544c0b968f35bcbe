"""Stress relaxation with two time constants: quasi-linear viscoelasticity.

The force is the convolution of the reduced relaxation function G with the rate of the elastic force (Fung,
Biomechanics, 1993, section 7.6): G(t) = 1 - sum g_i (1 - exp(-t / tau_i)), a Prony series.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schemas.plain_sum import plain_sum
from schemas.vectors import Vector

__all__ = ["Prony"]


@dataclass(frozen=True)
class Prony:
    """The relaxing shares g_i of the force, and their time constants tau_i, s; both of length 2."""

    shares: tuple[float, float]
    times: tuple[float, float]

    @property
    def remaining(self) -> float:
        """Share of the force that does not relax."""
        return 1.0 - plain_sum(self.shares)

    def relaxed(self, time: Vector, elastic: Vector) -> Vector:
        """Return the force at `time` (s, shape (n,), increasing) of the elastic force, shape (n,).

        Exact where the elastic force is linear between the samples; before the first there was none.
        """
        steps, rises = np.diff(time), np.diff(elastic, prepend=0.0)
        force = self.remaining * elastic
        for share, tau in zip(self.shares, self.times, strict=True):
            decay = np.exp(-steps / tau)
            gain = share * tau * -np.expm1(-steps / tau) / steps
            branch = np.empty_like(elastic)
            branch[0] = share * rises[0]
            for i, (keep, take) in enumerate(zip(decay.tolist(), gain.tolist(), strict=True), 1):
                branch[i] = keep * branch[i - 1] + take * rises[i]
            force = force + branch
        return force

    def at(self, frequency: float) -> tuple[float, float]:
        """Return storage modulus over instantaneous modulus, and loss over storage over w, s.

        At `frequency` (Hz), w = 2 pi frequency: stiffness and ratio of damping to stiffness of an equivalent
        body with proportional damping at this frequency.
        """
        w = 2.0 * np.pi * frequency
        shares, turned = np.array(self.shares), w * np.array(self.times)
        storage = 1.0 - shares.sum() + float(shares @ (turned**2 / (1.0 + turned**2)))
        loss = float(shares @ (turned / (1.0 + turned**2)))
        return float(storage), loss / float(storage) / w
