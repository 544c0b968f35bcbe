"""The rules of foreign evaluators, with sources: docs/scores.md."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from tasks.rules.cvs import CvsDoublet
from tasks.rules.fls import Fls
from tasks.rules.icra2026 import Icra2026, Icra2026Live
from tasks.rules.mscore import MScore
from tasks.rules.ochra import Ochra
from tasks.rules.rating import Gears, GoalsScale, Osats
from tasks.rules.rules import AnyRules, Rules, Setting, Suture
from tasks.rules.src import Src1, Src2Rules, Src2Script, Src3Rules, Src3Script
from tasks.rules.surrol import Surrol

__all__ = ["GENERAL", "RULES", "Rules", "Setting", "Suture"]

_GENERAL: tuple[type[AnyRules], ...] = (Icra2026, Icra2026Live, Surrol, Fls, MScore)
_SUTURES: tuple[type[AnyRules], ...] = (Src1, Src2Script, Src2Rules, Src3Script, Src3Rules)
_OPERATIONS: tuple[type[AnyRules], ...] = (CvsDoublet, GoalsScale, Gears, Osats, Ochra)
RULES: Mapping[str, type[AnyRules]] = MappingProxyType(
    {rules.name: rules for rules in (*_GENERAL, *_SUTURES, *_OPERATIONS)}
)
"""Sets of rules by name."""

GENERAL = tuple(rules.name for rules in _GENERAL)
"""Default rules of a task."""
