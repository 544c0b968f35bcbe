"""A file of YAML with the content of one pydantic model."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from typing import Any, TypeVar, cast

from pydantic import BaseModel, ValidationError
from ruamel.yaml import YAML, YAMLError

__all__ = ["load_yaml_model", "yaml_text"]

_Model = TypeVar("_Model", bound=BaseModel)


def load_yaml_model(
    model: type[_Model], file: Path, *, largest: int, writer: str, error: type[Exception]
) -> _Model:
    """Return the content of `file`.

    Args:
        model: model.
        file: path.
        largest: bytes that it may have.
        writer: the command that writes such files, for error messages.
        error: raised if the file cannot be read or is not valid.
    """
    try:
        if file.stat().st_size > largest:
            raise error(f"'{file}' is larger than {largest} bytes: not a file of `{writer}`")
        yaml: Any = YAML(typ="safe")
        return model.model_validate(yaml.load(file.read_text(encoding="utf-8")))
    except OSError as failure:
        raise error(f"cannot read '{file}': {failure.strerror}") from failure
    except ValidationError as failure:
        first = failure.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise error(f"'{file}': {where}: {first['msg']}; `{writer}` writes it") from failure
    except (YAMLError, UnicodeDecodeError) as failure:
        raise error(f"'{file}' is not YAML: {failure}") from failure


def yaml_text(model: BaseModel, *, compact: bool = False) -> str:
    """Return the content as YAML; `compact`: a list of numbers in one line."""
    stream, yaml = StringIO(), cast("Any", YAML())
    if compact:
        yaml.default_flow_style = None
    yaml.dump(model.model_dump(mode="json"), stream)
    return stream.getvalue()
