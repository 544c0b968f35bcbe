"""A prescribed probe motion against a fem engine."""

from engines.fem.engine import FemEngine
from engines.fem.params import FemParams
from tests.engines.bullet.rig import BLOCK, MS, Rig

__all__ = ["BLOCK", "MS", "FemRig", "params"]


def params(block=BLOCK, probe=None, **rest):
    """Return a block and a probe."""
    return FemParams.model_validate({"organs": {"block": block}, "probes": {"probe": probe or {}}} | rest)


class FemRig(Rig):
    """`Rig` with tissue of our own."""

    engine_class = FemEngine
