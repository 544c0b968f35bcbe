"""Letters as strokes: a text becomes line segments, drawn at any size and depth like all else.

MuJoCo's own labels have a fixed size in pixels and are not hidden by what is in front of them.
"""

from __future__ import annotations

import unicodedata
from itertools import pairwise

import numpy as np

from schemas.vectors import Vector

__all__ = ["STROKE", "segments"]

_CAPITAL = 6.0
"""Height of a capital letter in units of the grid, on which a digit for x and one for y are a point; the
baseline is at y = 2.
"""
_BASELINE = 2.0
_NARROWED, _ADVANCE, _LINE = 0.8, 4.6, 10.0
"""Width of a unit of x, distance of letters, distance of lines, in units of y."""
STROKE = 0.13
"""Thickness of a stroke as a share of a capital's height."""
_ROUND = "45 36 16 05 03 12 32 43"
_GLYPHS = {
    " ": "",
    "!": "28 24/22 22",
    '"': "18 16/38 36",
    "#": "12 18/32 38/04 44/06 46",
    "$": "47 38 18 07 06 15 35 44 43 32 12 03/28 22",
    "%": "02 48/08 18 17 07 08/33 43 42 32 33",
    "&": "42 07 18 28 37 04 03 12 22 44",
    "'": "28 26",
    "(": "38 26 24 32",
    ")": "18 26 24 12",
    "*": "14 36/16 34/05 45",
    "+": "23 27/05 45",
    ",": "23 22 11",
    "-": "05 45",
    ".": "22 22",
    "/": "02 48",
    ":": "22 22/26 26",
    ";": "26 26/23 22 11",
    "<": "47 05 43",
    "=": "04 44/06 46",
    ">": "07 45 03",
    "?": "07 18 38 47 46 25 24/22 22",
    "@": "34 36 16 14 44 47 38 18 07 03 12 42",
    "[": "38 18 12 32",
    "\\": "08 42",
    "]": "18 38 32 12",
    "^": "06 28 46",
    "_": "01 41",
    "`": "18 26",
    "{": "38 27 26 15 24 23 32",
    "|": "28 20",
    "}": "18 27 26 35 24 23 12",
    "~": "04 15 34 45",
    "\u00b0": "17 28 37 26 17",
    "0": "18 38 47 43 32 12 03 07 18/03 47",
    "1": "17 28 22/12 32",
    "2": "07 18 38 47 46 02 42",
    "3": "07 18 38 47 46 35 44 43 32 12 03/15 35",
    "4": "32 38 04 44",
    "5": "48 08 05 35 44 43 32 02",
    "6": "47 38 18 07 03 12 32 43 44 35 15 04",
    "7": "08 48 22",
    "8": "15 06 07 18 38 47 46 35 15 04 03 12 32 43 44 35",
    "9": "03 12 32 43 47 38 18 07 06 15 35 46",
    "A": "02 28 42/14 34",
    "B": "02 08 38 47 46 35 05/35 44 43 32 02",
    "C": "47 38 18 07 03 12 32 43",
    "D": "02 08 28 46 44 22 02",
    "E": "48 08 02 42/05 35",
    "F": "48 08 02/05 35",
    "G": "47 38 18 07 03 12 32 43 45 25",
    "H": "08 02/48 42/05 45",
    "I": "18 38/28 22/12 32",
    "J": "48 43 32 12 03",
    "K": "08 02/48 05 42",
    "L": "08 02 42",
    "M": "02 08 25 48 42",
    "N": "02 08 42 48",
    "O": "18 38 47 43 32 12 03 07 18",
    "P": "02 08 38 47 46 35 05",
    "Q": "18 38 47 43 32 12 03 07 18/24 42",
    "R": "02 08 38 47 46 35 05/25 42",
    "S": "47 38 18 07 06 15 35 44 43 32 12 03",
    "T": "08 48/28 22",
    "U": "08 03 12 32 43 48",
    "V": "08 22 48",
    "W": "08 12 25 32 48",
    "X": "08 42/48 02",
    "Y": "08 25 48/25 22",
    "Z": "08 48 02 42",
    "a": f"46 42/{_ROUND}",
    "b": "08 02/05 16 36 45 43 32 12 03",
    "c": _ROUND,
    "d": f"48 42/{_ROUND}",
    "e": "04 44 45 36 16 05 03 12 32 43",
    "f": "47 38 27 22/16 36",
    "g": f"46 41 30 10 01/{_ROUND}",
    "h": "08 02/05 16 36 45 42",
    "i": "26 22/28 28",
    "j": "36 31 20 10/38 38",
    "k": "08 02/46 04 42",
    "l": "18 28 23 32",
    "m": "02 06/05 16 25 22/25 36 45 42",
    "n": "02 06/05 16 36 45 42",
    "o": "16 36 45 43 32 12 03 05 16",
    "p": "06 00/05 16 36 45 43 32 12 03",
    "q": f"46 40/{_ROUND}",
    "r": "02 06/05 16 36 45",
    "s": "45 36 16 05 14 34 43 32 12 03",
    "t": "18 13 22 32 43/06 36",
    "u": "06 03 12 32 43/46 42",
    "v": "06 22 46",
    "w": "06 12 25 32 46",
    "x": "06 42/46 02",
    "y": "06 22/46 10 00",
    "z": "06 46 02 42",
}
_UNKNOWN = "02 08 48 42 02"


def segments(text: str, height: float) -> Vector:
    """Return the strokes of `text` as line segments in a plane, shape (n, 2, 2): x to the right, y up, m.

    `height`: of a capital letter, m. The text is centred about the origin; a letter without a glyph is shown
    without its accents or, failing that, as a box.
    """
    lines = unicodedata.normalize("NFKD", text).split("\n")
    unit, found = height / _CAPITAL, list[tuple[tuple[float, float], tuple[float, float]]]()
    for row, line in enumerate(lines):
        letters = [letter for letter in line if not unicodedata.combining(letter)]
        left = -0.5 * (_ADVANCE * len(letters) - (_ADVANCE - 4.0 * _NARROWED))
        base = -0.5 * _CAPITAL + _LINE * (0.5 * (len(lines) - 1) - row)
        for column, letter in enumerate(letters):
            for stroke in filter(None, _GLYPHS.get(letter, _UNKNOWN).split("/")):
                points = [
                    (left + _ADVANCE * column + _NARROWED * int(x), base + int(y) - _BASELINE)
                    for x, y in stroke.split(" ")
                ]
                found += pairwise(points)
    return unit * np.array(found).reshape(-1, 2, 2)
