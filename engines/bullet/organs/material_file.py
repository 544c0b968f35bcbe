"""The file of a user's own tissue, written by `trocar calibrate tissue` and named in a scenario."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from typing import Annotated, Any, Self, cast

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from ruamel.yaml import YAML, YAMLError

from engines.bullet.organs.materials import TissueDensity, TissueModulus, TissuePoissonRatio

__all__ = ["MaterialFile"]

_LARGEST = 2**16
"""Most bytes of a file; a usual file has 1 KiB."""


class MaterialFile(BaseModel):
    """The content of a YAML file, SI units: constants of Bullet's material, and their provenance."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    young_modulus: TissueModulus
    """Storage modulus of the tissue at the frequency of `fit`, Pa."""
    poisson_ratio: TissuePoissonRatio
    density: TissueDensity
    damping: Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]
    """Ratio of damping to stiffness, s, for the loss at the frequency of `fit`."""
    friction: Annotated[float, Field(ge=0.0, le=2.0, allow_inf_nan=False)] | None = None
    """Coulomb's coefficient; None: not measured."""
    fit: dict[str, Any] = Field(default_factory=dict[str, Any])
    """Measured values with deviations, and quality of the fit; for the reader."""

    @classmethod
    def load(cls, file: Path) -> Self:
        """Return the content of `file`. Raises ValueError for an unreadable or invalid file."""
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
