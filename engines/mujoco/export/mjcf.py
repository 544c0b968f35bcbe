"""The model as MJCF.

MuJoCo writes numbers with six digits. All named elements get full numbers here, so the model reads back
unchanged.
"""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import mujoco
import numpy as np

from engines.mujoco.export.assets import FOLDER, file_of, numbers
from schemas.vectors import Vector

__all__ = ["mjcf"]

_INERTIAL = {"pos": "ipos", "quat": "iquat", "diaginertia": "inertia"}
"""Attributes of the element `inertial` with another name in a compiled body."""
_EQUALITY = {"polycoef": "data"}
_DIGITS = 1e-5
"""Rounding by six digits, relative to the largest number of the attribute."""


def mjcf(spec: mujoco.MjSpec) -> ElementTree.Element:
    """Return the root element of the model's MJCF, with meshes as files in `FOLDER`."""
    model = spec.compile()
    root = ElementTree.fromstring(spec.to_xml())
    (compiler,) = root.findall("compiler")
    compiler.set("meshdir", FOLDER)
    for mesh in root.findall("asset/mesh"):
        del mesh.attrib["vertex"], mesh.attrib["face"]
        mesh.set("file", file_of(mesh.attrib["name"]))
    by_tag = {
        "body": spec.body,
        "joint": spec.joint,
        "site": spec.site,
        "geom": spec.geom,
        "general": spec.actuator,
        "key": spec.key,
    }
    for element in root.iterfind("equality/joint"):
        _restore_digits(element, spec.equality(element.attrib["name"]), _EQUALITY)
    for element in root.iter():
        if element.tag in by_tag and (name := element.get("name")):
            _restore_digits(element, by_tag[element.tag](name), {})
            if (inertial := element.find("inertial")) is not None:
                _restore_digits(inertial, model.body(name), _INERTIAL)
    return root


def _restore_digits(element: ElementTree.Element, source: Any, names: dict[str, str]) -> None:
    """Give the numbers of `element` all digits of `source`.

    `names`: names in `source` of attributes, where different.
    """
    for attribute, text in element.attrib.items():
        value: Any = getattr(source, names.get(attribute, attribute), None)
        if not isinstance(value, float | np.ndarray):
            continue
        written = np.array(text.split(), float)
        exact: Vector = np.asarray(value, float).ravel()[: len(written)]
        if np.abs(exact - written).max() <= _DIGITS * np.abs(written).max():
            element.set(attribute, numbers(exact))
