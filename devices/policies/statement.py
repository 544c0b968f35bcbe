"""The check of a policy's own statement against the contract."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

from robots.policies.terms import Terms
from schemas.errors import ScenarioError

__all__ = ["check_statement"]


def check_statement(backend: str, metadata: Mapping[str, Any], terms: Terms) -> None:
    """Raise ScenarioError with everything in which a policy's entry `contract` differs from the terms."""
    stated = metadata.get("contract")
    if stated is None:
        return
    if not isinstance(stated, Mapping):
        misfits = [f"its contract is a {type(stated).__name__}, expected a mapping"]
    else:
        misfits = terms.misfits(cast("Mapping[str, Any]", stated))
    if misfits:
        raise ScenarioError(
            f"policy '{backend}' does not fit the contract: {'; '.join(misfits)}", path=("scene", "contract")
        )
