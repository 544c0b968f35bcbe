"""Errors of an operation: kinds of events, with the mode of error that each is an instance of.

The modes are those of observational clinical human reliability analysis (Tang et al., Arch. Surg. 139, 2004;
Joice et al. 1998): six of the order of steps, and those of a step done with too much, too little, at a wrong
place, in a wrong direction or on a wrong object.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

from tasks.events import EventKind

__all__ = ["ERRORS", "MODES", "NO_OPERATION", "ErrorKind", "Mode"]

NO_OPERATION = "these rules score an operation: run or record a task of kind cholecystectomy-task"
"""Reason for rows about an operation of a task that is none."""

Mode = Literal[
    "step_omitted",
    "step_partial",
    "step_repeated",
    "step_added",
    "step_replaced",
    "out_of_order",
    "too_much_force",
    "too_much_time",
    "too_little",
    "wrong_place",
    "wrong_direction",
    "wrong_object",
]
MODES: Mapping[Mode, str] = MappingProxyType(
    {
        "step_omitted": "",
        "step_partial": "",
        "step_repeated": "",
        "step_added": "an added step is not told from a needed one: no plan of the operator is known",
        "step_replaced": "a replaced step is not told from an omitted one",
        "out_of_order": "",
        "too_much_force": "",
        "too_much_time": "",
        "too_little": "",
        "wrong_place": "",
        "wrong_direction": "",
        "wrong_object": "",
    }
)
"""Reason for a mode that is not counted, by mode; empty: counted."""


class ErrorKind(NamedTuple):
    """A kind of error."""

    mode: Mode
    is_consequential: bool
    """Whether it harms, or has to be corrected (Tang et al. 2004)."""
    lasts: bool = False
    """Whether the tissue reports it again and again: within 2 s it is one error."""


ERRORS: Mapping[EventKind, ErrorKind] = MappingProxyType(
    {
        "cut without clip": ErrorKind("step_omitted", True),
        "cut with too few clips": ErrorKind("step_partial", True),
        "cut beside clips": ErrorKind("wrong_place", True),
        "cut with short cuff": ErrorKind("wrong_place", False),
        "clipped after cut": ErrorKind("out_of_order", True),
        "wrong structure clipped": ErrorKind("wrong_object", True),
        "wrong structure hurt": ErrorKind("wrong_object", True, lasts=True),
        "clip too near": ErrorKind("wrong_place", False),
        "clip across two": ErrorKind("wrong_object", True),
        "clip oblique": ErrorKind("wrong_direction", False),
        "clip not across": ErrorKind("too_little", True),
        "clip slipped": ErrorKind("step_repeated", True),
        "clip pulled off": ErrorKind("too_much_force", True),
        "tube torn": ErrorKind("too_much_force", True, lasts=True),
        "gallbladder perforated": ErrorKind("too_much_force", True, lasts=True),
        "grasp torn off": ErrorKind("too_much_force", True),
        "target burnt": ErrorKind("wrong_place", True, lasts=True),
        "energy in the air": ErrorKind("too_much_time", False),
        "energy on an instrument": ErrorKind("wrong_object", False),
        "exchanged while holding": ErrorKind("out_of_order", True),
    }
)
"""All kinds of errors."""
