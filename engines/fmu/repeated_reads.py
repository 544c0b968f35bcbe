"""Outputs that differ between two reads at the same instant: FMI lets no get function change a value."""

from __future__ import annotations

import logging

from engines.fmu.instance import Instance

__all__ = ["warn_of_changes"]

_log = logging.getLogger(__name__)


def warn_of_changes(instance: Instance, name: str) -> None:
    """Read all outputs once more, and log the changed ones; the values of the first read are kept."""
    changed: list[str] = []
    for block in instance.outputs:
        if block.clocks:
            continue
        before = block.raw.copy()
        instance.transfer(block)
        changed += block.differing(before)
        block.raw[:] = before
    if changed:
        _log.warning(
            "%s: reading changes the FMU: %s differed between two reads at the start. A value is read once a"
            " step here; another tool, which reads more often, will get other results",
            name,
            ", ".join(changed),
        )
