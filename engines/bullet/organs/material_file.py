"""The material of the reader's own tissue, as `trocar calibrate tissue` writes it and a scenario names it."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from typing import Annotated, Any, Self, cast

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from ruamel.yaml import YAML, YAMLError

from engines.bullet.organs.materials import TissueDensity, TissueModulus, TissuePoissonRatio

__all__ = ["MaterialFile"]

_LARGEST = 2**16
"""Bytes of a file; one has 1 KiB."""


class MaterialFile(BaseModel):
    """The content of a file of YAML, SI units: what Bullet's material takes, and how it was found."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    young_modulus: TissueModulus
    """Pa, as stiff as the tissue is at the frequency of `fit`."""
    poisson_ratio: TissuePoissonRatio
    density: TissueDensity
    damping: Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]
    """Ratio of damping to stiffness, s, for the loss at that frequency."""
    friction: Annotated[float, Field(ge=0.0, le=2.0, allow_inf_nan=False)] | None = None
    """Coulomb's coefficient; None: not measured."""
    fit: dict[str, Any] = Field(default_factory=dict[str, Any])
    """What was measured, with deviations, and how well it fits; for the reader."""

    @classmethod
    def load(cls, file: Path) -> Self:
        """Return the content of `file`. Raises ValueError if it cannot be read or is not valid."""
        try:
            if file.stat().st_size > _LARGEST:
                raise ValueError(
                    f"'{file}' is larger than {_LARGEST} bytes: not a file of `trocar calibrate`"
                )
            yaml: Any = YAML(typ="safe")
            return cls.model_validate(yaml.load(file.read_text(encoding="utf-8")))
        except OSError as error:
            raise ValueError(f"cannot read '{file}': {error.strerror}") from error
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = ".".join(map(str, first["loc"]))
            raise ValueError(
                f"'{file}': {where}: {first['msg']}; `trocar calibrate tissue` writes it"
            ) from error
        except (YAMLError, UnicodeDecodeError) as error:
            raise ValueError(f"'{file}' is not YAML: {error}") from error

    def text(self) -> str:
        """Return the content as YAML."""
        stream, yaml = StringIO(), cast("Any", YAML())
        yaml.dump(self.model_dump(mode="json"), stream)
        return stream.getvalue()
