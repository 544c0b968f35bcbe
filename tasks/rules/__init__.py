"""The rules of other evaluators, each with its source: docs/scores.md."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from tasks.rules.fls import Fls
from tasks.rules.icra2026 import Icra2026, Icra2026Live
from tasks.rules.mscore import MScore
from tasks.rules.rules import AnyRules, Rules, Setting
from tasks.rules.surrol import Surrol

__all__ = ["RULES", "Rules", "Setting"]

_ALL: tuple[type[AnyRules], ...] = (Icra2026, Icra2026Live, Surrol, Fls, MScore)
RULES: Mapping[str, type[AnyRules]] = MappingProxyType({rules.name: rules for rules in _ALL})
"""By name."""
