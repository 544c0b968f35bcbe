"""A patient's organs and attachments, as a scenario states them."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np

from anatomy.drape import drape
from anatomy.layout import Layout, Line
from anatomy.patient import (
    ARTERY_WALL,
    COMMON_DUCT_WALL,
    DUCT_WALL,
    HEPATIC_ARTERY_DIAMETER,
    HEPATIC_ARTERY_WALL,
    Patient,
)
from anatomy.phase import Phase

__all__ = ["attachments_of", "organs_of"]

_DIGITS = 6
_LIVER_SIZE = 0.120, 0.118, 0.032
_LIVER_MIDDLE = np.array([-0.010, 0.028, 0.0])
_DEPTH_IN_FOSSA = 0.45
"""Height of the liver's face over the gallbladder's centre line, below it, over its radius."""
_CLEARANCE_FREED, _CLEARANCE = 0.004, 0.0006
"""Width of the gap between liver and gallbladder where it has been freed, and elsewhere, m."""
_OPENED = 0.36
"""Share of the cystic plate that is free in the critical view of safety: a little more than a third."""
_BEFORE_DISSECTION: tuple[Phase, ...] = ("calot-dissection", "cholecystectomy")
"""Phases that begin with fat over the triangle, and a whole plate."""
_MMHG = 133.322

_SOFT: dict[str, Any] = {"poisson_ratio": 0.45, "friction": 0.2}
_DUCT_CUTTING: dict[str, Any] = {"toughness": 300.0}
"""Between a sharp cut of aorta (290 J/m^2) and a tear (1.7 kJ/m^2); estimated."""
_BILE: dict[str, Any] = {"liquid": "bile", "pressure": 10.0 * _MMHG, "supply": ["right"]}
_BILE_VOLUME = 28e-6
"""Fasting, m^3: 26.5 ml of women, 29.9 ml of men in ultrasound of 400 adults (Zanco J. Med. Sci.)."""
_BILE_MOVES = 4.0
"""Inertia of the gallbladder: 16 g of wall move with 28 ml of bile (3), and a little more."""
_TUBE_INERTIA = 25.0
"""Inertia of ducts and vessels, for sub-steps of 0.1 ms: 0.3 g of duct move as 8 g."""
_JOINT: dict[str, Any] = {"strength": 1e6, "toughness": 1000.0}
"""As a duct or vessel itself; assumed."""


_FILLS, _STONE_LENGTH = 0.85, 1.2
"""Diagonal of a stone over the width of the lumen at its lower end, and length over width; assumed."""
_STONE_MODULUS = 150e3
"""Pa; assumed: three times that of the wall keeps jaws apart, and steps of 2 ms stay stable."""
_IMPACTED = 0.003
"""Largest distance between stone and wall where the stone sticks, m."""
_FAT: dict[str, Any] = {"strength": 5e3, "toughness": 20.0}
"""Areolar tissue between fat and what lies below; assumed."""
_FAT_OFF, _FAT_SIZE = np.array([-0.003, 0.006]), (0.034, 0.034)
"""Middle of the fat beside that of the cystic duct, along x and y, and its extent, m."""
_FAT_THICKNESS, _FAT_FLOOR, _FAT_HEIGHTS = 0.003, -0.012, 13
"""Thickness of peritoneum and fat over the triangle, lowest height of the underside, m; heights a side."""
_FAT_GAP = 0.0008
_FAT_MODULUS = 10e3
"""Of peritoneum and fat together, Pa: 3 mm of fat (2.3 kPa, `trocar organs`) bear 7 N/m, 0.1 mm (assumed)
of a membrane as mesentery (shear modulus 21 to 186 kPa in the rabbit, torsion) 6 to 56 N/m; so 4 to 21 kPa.
"""


def organs_of(patient: Patient, phase: Phase) -> dict[str, dict[str, Any]]:
    """Return the organs by name."""
    layout = Layout(patient, is_dissected=phase not in _BEFORE_DISSECTION)
    makers: dict[str, Callable[[Patient, Layout], dict[str, Any]]] = {
        "liver": _liver,
        "gallbladder": _gallbladder,
        "cystic_duct": _cystic_duct,
        "cystic_artery": _cystic_artery,
        "common_bile_duct": _common_bile_duct,
        "hepatic_artery": _hepatic_artery,
    }
    made = {name: make(patient, layout) for name, make in makers.items()}
    if patient.stone:
        made["stone"] = _stone(layout)
    if phase in _BEFORE_DISSECTION:
        made["fat"] = _fat(patient, layout)
    if phase in ("gallbladder-bed", "cholecystectomy"):
        made["liver"] |= {"cutting": {}, "bleeding": {}}
    if phase == "gallbladder-bed":
        del made["cystic_duct"], made["cystic_artery"]
    return made


def attachments_of(patient: Patient, phase: Phase) -> dict[str, dict[str, Any]]:
    """Return the attachments by name."""
    found = _plate(patient, 0.0 if phase in _BEFORE_DISSECTION else _OPENED)
    if phase != "gallbladder-bed":
        found |= _joints(patient)
    if patient.stone:
        found["stone_wall"] = {"organs": ["stone", "gallbladder"], "within": _IMPACTED, **_JOINT}
    if phase in _BEFORE_DISSECTION:
        for name in _under_fat(patient):
            found[f"fat_{name}"] = {"organs": ["fat", name], "surface": "underside", "within": 0.002, **_FAT}
    return found


def _under_fat(patient: Patient) -> list[str]:
    """Return the organs that the fat lies on: an artery in front keeps it off the ducts."""
    in_front = patient.artery == "front"
    return ["gallbladder", *(["cystic_artery"] if in_front else ["cystic_duct", "common_bile_duct"])]


def _plate(patient: Patient, opened: float) -> dict[str, dict[str, Any]]:
    return {
        "cystic_plate": {
            "organs": ["gallbladder", "liver"],
            "surface": "bed",
            "within": 0.006,
            "lower_end": np.round(Layout(patient).neck, _DIGITS).tolist(),
            "opened": opened,
        }
    }


def _joints(patient: Patient) -> dict[str, dict[str, Any]]:
    touching = 0.25 * patient.common_duct_diameter + 0.001
    return {
        "neck_duct": {"organs": ["cystic_duct", "gallbladder"], "surface": "left", "within": 0.002, **_JOINT},
        "duct_confluence": {
            "organs": ["cystic_duct", "common_bile_duct"],
            "surface": "right",
            "within": touching,
            **_JOINT,
        },
        "neck_artery": {
            "organs": ["cystic_artery", "gallbladder"],
            "surface": "left",
            "within": 0.003,
            **_JOINT,
        },
        "artery_origin": {
            "organs": ["cystic_artery", "hepatic_artery"],
            "surface": "right",
            "within": 0.003,
            **_JOINT,
        },
    }


def _points(line: Line) -> list[list[float]]:
    return np.round(line, _DIGITS).tolist()


def _liver(patient: Patient, layout: Layout) -> dict[str, Any]:
    line, radii = layout.gallbladder, 0.5 * layout.gallbladder_diameters
    body = 4  # the widest point of the body
    position = _LIVER_MIDDLE + np.array([layout.neck[0], 0.0, line[body, 2] - _DEPTH_IN_FOSSA * radii[body]])
    gap = np.where(np.arange(len(line)) < 3, _CLEARANCE_FREED, _CLEARANCE)
    lies = line[1:] - position
    return {
        "visceral_face": {
            "size": _LIVER_SIZE,
            "porta": 0.022,
            "fossa": _points(lies),
            "diameters": np.round(2.0 * (radii + gap)[1:], _DIGITS).tolist(),
        },
        "nodes": 900,
        "position": np.round(position, _DIGITS).tolist(),
        "young_modulus": patient.liver_modulus,
        "density": 1060.0,
        **_SOFT,
        "anchors": [{"surface": "back"}],
    }


def _gallbladder(patient: Patient, layout: Layout) -> dict[str, Any]:
    return {
        "tube": {
            "path": _points(layout.gallbladder),
            "diameters": np.round(layout.gallbladder_diameters, _DIGITS).tolist(),
            "wall": np.round(layout.gallbladder_walls, _DIGITS).tolist(),
            "closed": "right",
        },
        "nodes": 480,
        "young_modulus": patient.gallbladder_modulus,
        **_SOFT,
        "inertia": _BILE_MOVES,
        "anchors": [{"surface": "right"}],
        "cutting": _DUCT_CUTTING,
        "lumen": {**_BILE, "volume": _BILE_VOLUME},
    }


def _stone(layout: Layout) -> dict[str, Any]:
    """Return a stone with flat faces whose edges lie at the wall."""
    end, along, lumen = layout.stone
    width = lumen * _FILLS / sqrt(2.0)
    size = width, width, _STONE_LENGTH * width
    half_turn = np.array([-along[1], along[0], 0.0, 1.0 + along[2]])
    return {
        "size": [round(edge, _DIGITS) for edge in size],
        "nodes": 75,
        "position": np.round(end + size[2] * along, _DIGITS).tolist(),
        "orientation": np.round(half_turn / np.linalg.norm(half_turn), _DIGITS).tolist(),
        "young_modulus": _STONE_MODULUS,
        "density": 1100.0,
        "inertia": _TUBE_INERTIA,
        **_SOFT,
        "anchors": [],
    }


def _fat(patient: Patient, layout: Layout) -> dict[str, Any]:
    tubes = [
        (layout.gallbladder, 0.5 * layout.gallbladder_diameters),
        *(
            (line, np.full(len(line), 0.5 * diameter))
            for line, diameter in (
                (layout.cystic_duct, patient.duct_diameter),
                (layout.cystic_artery, patient.artery_diameter),
                (layout.common_duct, patient.common_duct_diameter),
            )
        ),
    ]
    shares = np.linspace(-0.5, 0.5, _FAT_HEIGHTS)
    middle = np.append(0.5 * (layout.neck + layout.confluence)[:2] + _FAT_OFF, 0.0)
    xs, ys = (middle[i] + _FAT_SIZE[i] * shares for i in (0, 1))
    heights = drape(xs, ys, tubes, _FAT_GAP, _FAT_FLOOR)
    return {
        "sheet": {
            "size": _FAT_SIZE,
            "thickness": _FAT_THICKNESS,
            "heights": np.round(heights, _DIGITS).tolist(),
        },
        "nodes": 500,
        "position": np.round(middle, _DIGITS).tolist(),
        "material": "fat",
        "young_modulus": _FAT_MODULUS,
        "density": 911.0,
        "inertia": 4.0,
        **_SOFT,
        "anchors": [],
        "cutting": {"toughness": 100.0},
    }


def _cystic_duct(patient: Patient, layout: Layout) -> dict[str, Any]:
    wide = patient.duct_diameter + 0.0012
    diameters = [wide, patient.duct_diameter + 0.0003, *[patient.duct_diameter] * 4]
    return {
        "tube": {
            "path": _points(layout.cystic_duct),
            "diameters": np.round(diameters, _DIGITS).tolist(),
            "wall": DUCT_WALL,
        },
        "nodes": 300 if patient.short_duct else 240,
        "young_modulus": patient.duct_modulus,
        "inertia": _TUBE_INERTIA,
        **_SOFT,
        "anchors": [],
        "cutting": _DUCT_CUTTING,
        "lumen": {**_BILE, "supply": ["left", "right"], "reserve": _BILE_VOLUME},
    }


def _cystic_artery(patient: Patient, layout: Layout) -> dict[str, Any]:
    return {
        "tube": {
            "path": _points(layout.cystic_artery),
            "diameter": round(patient.artery_diameter, _DIGITS),
            "wall": ARTERY_WALL,
        },
        "nodes": 160,
        "young_modulus": patient.artery_modulus,
        "inertia": _TUBE_INERTIA,
        **_SOFT,
        "anchors": [],
        "cutting": _DUCT_CUTTING,
        "lumen": {"supply": ["right"]},
    }


def _common_bile_duct(patient: Patient, layout: Layout) -> dict[str, Any]:
    return {
        "tube": {
            "path": _points(layout.common_duct),
            "diameter": round(patient.common_duct_diameter, _DIGITS),
            "wall": COMMON_DUCT_WALL,
        },
        "nodes": 300,
        "young_modulus": patient.duct_modulus,
        "inertia": _TUBE_INERTIA,
        **_SOFT,
        "anchors": [{"surface": "left"}, {"surface": "right"}, {"surface": "bed"}],
        "cutting": _DUCT_CUTTING,
        "lumen": {**_BILE, "supply": ["left", "right"]},
    }


def _hepatic_artery(patient: Patient, layout: Layout) -> dict[str, Any]:
    return {
        "tube": {
            "path": _points(layout.hepatic_artery),
            "diameter": HEPATIC_ARTERY_DIAMETER,
            "wall": HEPATIC_ARTERY_WALL,
        },
        "nodes": 140,
        "young_modulus": patient.artery_modulus,
        "inertia": _TUBE_INERTIA,
        **_SOFT,
        "anchors": [{"surface": "left"}, {"surface": "right"}, {"surface": "bed"}],
        "cutting": _DUCT_CUTTING,
        "lumen": {"supply": ["left"]},
    }
