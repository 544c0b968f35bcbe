"""The organs and attachments of a patient, added to parameters that have not been validated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

from anatomy.params import AnatomyParams

__all__ = ["add_anatomy"]

_FORMS = frozenset({"size", "shape", "mesh", "tube", "visceral_face", "sheet"})
_MATERIALS = frozenset({"material", "material_file", "young_modulus"})
_OF_MODULUS = frozenset({"poisson_ratio", "density"})


def add_anatomy(given: Any) -> Any:
    """Return parameters with the organs and attachments of their `anatomy`, if any.

    Stiff tubes lie beside a soft liver: organs have sub-steps of their own, unless it is stated otherwise.
    Fields of an organ or attachment of the same name replace the patient's. A patient that is not stated is
    that of the `seed`.
    """
    if not isinstance(given, Mapping):
        return given
    tree = dict(cast("Mapping[str, Any]", given))
    if tree.get("anatomy") is None:
        return tree
    tree.setdefault("own_sub_steps", True)
    anatomy = AnatomyParams.model_validate(tree["anatomy"])
    if anatomy.patient is None:
        anatomy = anatomy.model_copy(update={"patient": tree.get("seed")})
    tree["anatomy"] = anatomy
    for key, made in (("organs", anatomy.organs), ("attachments", anatomy.attachments)):
        own: Any = tree.get(key) or {}
        if isinstance(own, Mapping):
            stated = cast("Mapping[str, Any]", own)
            tree[key] = made | {name: _change(made.get(name), fields) for name, fields in stated.items()}
    return tree


def _change(made: dict[str, Any] | None, fields: Any) -> Any:
    """Return a patient's organ or attachment with other fields; another form or material replaces its own."""
    if made is None or not isinstance(fields, Mapping):
        return fields
    own = {key: value for key, value in cast("Mapping[str, Any]", fields).items() if value is not None}
    dropped: frozenset[str] = frozenset()
    for group, more in ((_FORMS, frozenset[str]()), (_MATERIALS, _OF_MODULUS)):
        if group & own.keys():
            dropped |= group | more
    return {key: value for key, value in made.items() if key not in dropped} | own
