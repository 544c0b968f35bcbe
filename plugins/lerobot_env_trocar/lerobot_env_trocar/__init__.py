"""Trocar's training scenes for LeRobot: importing this package registers `--env.type=trocar`."""

from __future__ import annotations

from importlib.util import find_spec

if find_spec("lerobot") is not None:  # EnvHub's `make_env` works without
    from lerobot_env_trocar.config import TrocarEnv

    __all__ = ["TrocarEnv"]
