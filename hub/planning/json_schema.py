"""JSON schemas of parameters, each made once: pydantic takes some 30 ms for the larger ones."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from pydantic import BaseModel

__all__ = ["json_schema"]


@lru_cache(maxsize=64)
def json_schema(model: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON schema of a model's values."""
    return model.model_json_schema()
