"""The appearance of a session as a page loads it: meshes, texture coordinates, textures by hash."""

from __future__ import annotations

import gzip
import logging
from collections.abc import Callable, Iterable, Mapping
from hashlib import sha256
from importlib.metadata import entry_points
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hub.participant import Params
from hub.participant.appearance import Appearance, Coat, RestBody, Skin, Texture
from schemas.scenario import Scenario
from webconsole.packing import pack

__all__ = ["GROUP", "PageAppearance", "find_appearance"]

log = logging.getLogger(__name__)

GROUP = "trocar.appearances"
"""Entry-point group: kind of participant -> function from parameters and soft bodies to an appearance."""
_FIRST = "endoscope"
"""Kind of the participant that is asked first: an endoscope names tissues and the place."""
_DIGITS = 32
"""Hexadecimal digits of a hash."""


class PageAppearance:
    """The answer to a page, and the files of its textures."""

    def __init__(self, appearance: Appearance, surfaces: Mapping[str, RestBody | None]) -> None:
        """`surfaces`: soft bodies at rest by name, in the order of the page; None: unknown yet."""
        self.textures: dict[str, bytes] = {}
        """Pictures of type JPEG, by hash."""
        blob = bytearray()
        described = {
            "place": appearance.place,
            "vignette": appearance.vignette,
            "surfaces": [
                self._surface(appearance.skins.get(name), body, blob) for name, body in surfaces.items()
            ],
            "kinds": {int(kind): self._coat(coat) for kind, coat in appearance.kinds.items()},
            "coats": {name: self._coat(coat) for name, coat in appearance.coats.items()},
            "surroundings": [
                {
                    "texture": self._texture(part.texture),
                    "vertices": _put(part.vertices, "<f4", blob),
                    "faces": _put(part.faces, "<u4", blob),
                    "uv": _put(part.uv, "<f4", blob),
                }
                for part in appearance.surroundings
            ],
        }
        self.packed = gzip.compress(pack(described, blob), 5, mtime=0)
        """Description and numbers, compressed by gzip."""

    def _surface(self, skin: Skin | None, body: RestBody | None, blob: bytearray) -> dict[str, Any] | None:
        if skin is None or body is None:
            return None
        return {
            "texture": self._texture(skin.texture),
            "rest": _put(body.nodes, "<f4", blob),
            "uv": _put(skin.uv, "<f4", blob),
            "charts": _put(skin.charts, "<u4", blob),
        }

    def _coat(self, coat: Coat) -> dict[str, Any]:
        return {"texture": self._texture(coat.texture), "tile": coat.tile_m, "metal": coat.metal}

    def _texture(self, texture: Texture) -> dict[str, str]:
        """Keep the pictures of a texture, and return their hashes."""
        found: dict[str, str] = {}
        for name, picture in texture._asdict().items():
            found[name] = sha256(picture).hexdigest()[:_DIGITS]
            self.textures[found[name]] = picture
        return found


def find_appearance(
    scenario: Scenario, params: Callable[[str], Params], surfaces: Mapping[str, RestBody | None]
) -> PageAppearance | None:
    """Return the appearance of a session by the first participant that has one; None: none has.

    Args:
        scenario: of the session.
        params: returns the validated parameters of a participant.
        surfaces: soft bodies at rest by outlet of their nodes, in the order of the page; None: unknown yet.
    """
    bodies = dict(zip(_body_names(surfaces), surfaces.values(), strict=True))
    known = {name: body for name, body in bodies.items() if body is not None}
    order = sorted(scenario.participants.items(), key=lambda item: item[1].kind != _FIRST)
    for participant, spec in order:
        for entry in entry_points(group=GROUP, name=spec.kind):
            try:
                make: Callable[[Params, Mapping[str, RestBody]], Appearance] = entry.load()
                return PageAppearance(make(params(participant), known), bodies)
            except Exception as error:  # noqa: BLE001  # a plug-in may raise anything; the page is drawn plain
                log.warning("no textures by '%s' (kind %s): %s", participant, spec.kind, error)
    return None


def _body_names(outlets: Iterable[str]) -> list[str]:
    """Return the name of each soft body: that of its port where no other participant has the same."""
    bare = [outlet.removesuffix("/nodes") for outlet in outlets]
    short = [name.partition(".")[2] for name in bare]
    return [one if short.count(one) == 1 else name for one, name in zip(short, bare, strict=True)]


def _put(array: NDArray[Any], kind: str, blob: bytearray) -> dict[str, int]:
    """Append an array to the numbers; return where it is, and how many numbers it has."""
    place = {"at": len(blob), "count": array.size}
    blob += np.ascontiguousarray(array, kind).tobytes()
    return place
