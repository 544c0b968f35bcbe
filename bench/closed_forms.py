"""Blood, cuts, tears, clips and attachments of kind fem in small set-ups, beside their closed forms."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from math import pi
from pathlib import Path
from typing import NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' rigs

from bench.fem_forces import DEPTH, cut, tear
from engines.fem.blood.film import BLOOD
from engines.fem.blood.lumen import opening_flow
from tests.engines.fem.blood.test_bleeding import FLUX, START, BloodRig, area_of
from tests.engines.fem.blood.test_lumen import MMHG, TubeRig, pull_at_clip
from tests.engines.fem.test_attachments import AREA, STRENGTH, TOUGHNESS, UP, PlateRig
from tests.engines.fem.test_cut import across

__all__ = ["LIMIT", "Figure", "closed_forms"]

LIMIT = 0.05
"""Largest relative error asked for."""


class Figure(NamedTuple):
    """A number and its closed form."""

    name: str
    found: float
    expected: float
    unit: str

    @property
    def error(self) -> float:
        """Relative error; the number itself where 0 is expected."""
        return abs(self.found / self.expected - 1.0) if self.expected else abs(self.found)


def bleeding_cut() -> Iterator[Figure]:
    """Flow out of a cut: perfusion, density and depth times area; the volume is the integral of the flow."""
    with BloodRig(START) as rig:
        rig.move(START + np.array([0.04, 0.0, 0.0]), 0.5)
        yield Figure("flow out of a cut, by area and perfusion", rig.rate, 1e6 * FLUX * area_of(rig), "ml/s")
        before = float(rig.volumes[0])
        rig.hold(0.4)
        yield Figure("blood lost, by flow and time", float(rig.volumes[0]) - before, 0.4 * rig.rate, "ml")
        yield Figure("blood that is nowhere", float(rig.bleeding.imbalance), 0.0, "")


def parted_tube() -> Iterator[Figure]:
    """Flow out of both stumps of a parted tube: orifice and Poiseuille in series; a clip shuts each."""
    with TubeRig() as rig:
        rig.open(0.0)
        rig.hold(0.016)
        area = float(rig.lumen.areas(rig.organ.mesh.nodes).mean())
        yield Figure("lumen of a tube, by a circle", area, pi * 1.5e-3**2, "m^2")
        resistance = 8.0 * pi * BLOOD.viscosity * 20e-3 / area**2
        expected = 2.0 * opening_flow(78.0 * MMHG, area, resistance, BLOOD.density)
        yield Figure("flow out of a parted tube, by orifice and Poiseuille", rig.rate, expected, "m^3/s")
        both = rig.rate
        rig.clip(-6e-3)
        yield Figure("the same with a clip on one side", rig.rate, 0.5 * both, "m^3/s")
        rig.clip(6e-3)
        yield Figure("the same with clips on both sides", rig.rate, 0.0, "m^3/s")


def clip_that_comes_off() -> Iterator[Figure]:
    """Force at which a clip comes off, along and across a tube: as stated, the same in all directions."""
    for way, name, force in (((1.0, 0.0, 0.0), "along", 0.3), ((0.0, 1.0, 0.0), "across", 0.05)):
        with TubeRig({"hold_along": force, "hold_across": force}) as rig:
            event, _ = pull_at_clip(rig, way, 8e-3)
            found = np.nan if event is None else event.size
            yield Figure(f"pull {name} a tube that takes a clip off", float(found), force, "N")


def blade() -> Iterator[Figure]:
    """Force and work of a blade through a block: toughness times width, and times area."""
    _, forces, theory, _ = cut()
    yield Figure("force of a blade, by toughness and depth", float(forces[150:250].mean()), theory, "N")
    step = float(np.diff(across(DEPTH)[:2, 0, 0])[0])
    yield Figure("work of the same, by area", float(forces.sum()) * step, theory * 0.03, "J")


def torn_strip() -> Iterator[Figure]:
    """Largest force of a strip that is pulled apart: stress at the limit of stretch times cross-section."""
    _, forces, theory, _ = tear()
    yield Figure("force at which a strip tears, by its stretch", float(forces.max()), theory, "N")


def peeled_plate() -> Iterator[Figure]:
    """Work and largest pull of a flap that is torn off its bed: toughness and strength times area."""
    with PlateRig(gravity=0.0) as rig:
        rig.take()
        felt: list[float] = []
        for _ in range(100):
            rig.move(rig.at + UP, 0.008)
            felt.append(float(rig.pulled[2]))
        work = float(sum(rig.power)) * 1e-3
        yield Figure("work of tearing an attachment off, by toughness", work, TOUGHNESS * AREA, "J")
        yield Figure("largest pull of the same, by strength", -min(felt), STRENGTH * AREA, "N")


_SET_UPS: tuple[Callable[[], Iterator[Figure]], ...] = (
    bleeding_cut,
    parted_tube,
    clip_that_comes_off,
    blade,
    torn_strip,
    peeled_plate,
)


def closed_forms() -> int:
    """Print all figures; return the number of those beyond the limit."""
    beyond = 0
    for set_up in _SET_UPS:
        for figure in set_up():
            beyond += not figure.error <= LIMIT
            print(json.dumps(figure._asdict() | {"error": round(figure.error, 6)}))
    print(f"{beyond} beyond {100 * LIMIT:g} %")
    return beyond
