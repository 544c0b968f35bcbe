"""Environments to learn in, after Gymnasium: importing this module registers them as `trocar/...-v0`.

    import trocar.environments     # before numpy: then state hashes are those of the command line
    import gymnasium

    env = gymnasium.make("trocar/NeedlePick-v0", reward="sparse", record="recordings/needle")

What an environment observes, does and rewards: docs/how-to/learn.md. The public name is
`trocar.environments`.
"""

from __future__ import annotations

from importlib import import_module

import_module("trocar.sessions")  # pins numpy's kernels, so it comes before all that imports numpy

from learning.environments.registration import ENVIRONMENTS, register  # noqa: E402

__all__ = ["ENVIRONMENTS", "register"]

register()
