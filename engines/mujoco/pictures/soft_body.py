"""A soft body of another engine, as its messages describe it."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray

from schemas.codec import decode, encode
from schemas.errors import MessageError, SessionError, StateError
from schemas.message import Message
from schemas.soft_surface import SoftSurface, film_steps
from schemas.trocar_msgs import SoftBodyState, SurfaceChange, SurfaceFilm

__all__ = ["SoftBody"]

_SHAPE = struct.Struct("<qq")
"""Number of nodes at rest and of triangles."""
_CHANGED = struct.Struct("<qq")
"""Negative length of the message of a changed surface, and number of nodes."""
_WET = struct.Struct("<qq")
"""Least number, and length of the message of a film."""
_LEAST = -(2**63)


class SoftBody:
    """A soft body as the messages on its ports describe it.

    The surface and the shape at rest come with the first message, the nodes with the newest; later changes of
    the surface, and liquid on the surface, have ports of their own.
    """

    def __init__(self, port: str, *, may_change: bool = False, may_be_wet: bool = False) -> None:
        """Name the port of the nodes, and say what may come.

        Args:
            port: name of the port of the nodes.
            may_change: changes of the surface may come.
            may_be_wet: liquid on a changed surface may come.
        """
        self._port, self.may_change, self.may_be_wet = port, may_change, may_be_wet
        self.rest: NDArray[np.float32] = np.zeros((0, 3), np.float32)
        """Nodes of the first message, shape (n, 3), m, frame `world`."""
        self.nodes = self.rest
        """Nodes named by the surface, shape (m, 3), m >= n, in m, frame `world`."""
        self.triangles: NDArray[np.uint32] = np.zeros((0, 3), np.uint32)
        """Surface of the first message: node indices, shape (f, 3), counter-clockwise from outside."""
        self._first = self._surface = SoftSurface.of_triangles(self.triangles, 0)
        self._change: SurfaceChange | None = None
        self._film: SurfaceFilm | None = None

    @property
    def film(self) -> NDArray[np.uint8]:
        """Thickness of the liquid at each of `nodes`, in steps of `FILM_STEP_M`, shape (m,)."""
        known = len(self.nodes)
        if self._film is None:
            return np.zeros(known, np.uint8)
        return film_steps(self._film, max(known, int(self._film.nodes.max(initial=0)) + 1))[:known]

    @property
    def liquid(self) -> str:
        """Name of the liquid on the surface."""
        return "blood" if self._film is None else self._film.liquid

    @property
    def version(self) -> int:
        """Version of the surface; 0: the triangles of the first message."""
        return 0 if self._change is None else self._change.version

    @property
    def surface(self) -> SoftSurface:
        """The surface as changed last."""
        return self._surface

    def accept(
        self, message: Message | None, change: Message | None = None, film: Message | None = None
    ) -> None:
        """Take the newest nodes, change of the surface, and liquid.

        Raises SessionError if the surface is unknown, or a message does not fit it.
        """
        if not isinstance(message, SoftBodyState) or message.nodes_m.size % 3:
            raise SessionError(
                f"input '{self._port}': expected the nodes of a soft body, three numbers each, got"
                f" {message!r}"
            )
        nodes = message.nodes_m.reshape(-1, 3)
        if not len(self.triangles):
            self._begin(nodes, message)
        if isinstance(change, SurfaceChange) and change.version != self.version:
            self._take(change)
        known = len(self._surface.origins)
        if len(nodes) < known:
            raise SessionError(
                f"input '{self._port}': {len(nodes)} nodes, but {known} before; a soft body keeps its nodes"
                " for a session"
            )
        # nodes appended for a change of which nothing is known here are not drawn
        self.nodes = nodes[:known]
        if isinstance(film, SurfaceFilm):
            self._wet(film, len(nodes))

    def _begin(self, nodes: NDArray[np.float32], first: SoftBodyState) -> None:
        if not first.triangles.size:
            raise SessionError(
                f"input '{self._port}': the first message has no triangles, which come with the state at time"
                " 0. An `order` that puts the tissue before this participant makes it miss that state: remove"
                " this participant from the order"
            )
        try:
            self._first = self._surface = SoftSurface.of_first(first)
        except MessageError as error:
            raise SessionError(f"input '{self._port}': {error}") from error
        self.rest = self.nodes = nodes
        self.triangles = first.triangles.reshape(-1, 3)

    def _take(self, change: SurfaceChange) -> None:
        try:
            self._surface = self._first.changed(change)
        except MessageError as error:
            raise SessionError(f"input '{self._port}': {error}") from error
        self._change = change if change.version else None

    def _wet(self, film: SurfaceFilm, nodes: int) -> None:
        try:
            film_steps(film, nodes)
        except MessageError as error:
            raise SessionError(f"input '{self._port}': {error}") from error
        self._film = film

    def save(self) -> bytes:
        """Return all soft bodies known from the messages."""
        wet = changed = b""
        if self._film is not None:
            message = encode(self._film)
            wet = _WET.pack(_LEAST, len(message)) + message
        if self._change is not None:
            message = encode(self._change)
            changed = _CHANGED.pack(-len(message), len(self.nodes)) + message
        return (
            wet
            + changed
            + _SHAPE.pack(len(self.rest), len(self.triangles))
            + self.rest.tobytes()
            + self.nodes.tobytes()
            + self.triangles.tobytes()
        )

    def restore(self, state: bytes) -> bytes:
        """Restore what `save` returned from the beginning of `state`; return what follows it.

        Raises StateError if it is incomplete.
        """
        try:
            return self._restore(state)
        except (struct.error, ValueError, MessageError) as error:
            raise StateError(
                f"a saved state of {len(state)} bytes contains no soft body for '{self._port}': {error}; was"
                " it saved by another scene?"
            ) from error

    def _restore(self, state: bytes) -> bytes:
        change, film, at = None, None, 0
        mark, length = _WET.unpack_from(state)
        if mark == _LEAST:
            at = _WET.size + length
            film = decode(SurfaceFilm, state[_WET.size : at])
            film_steps(film, int(film.nodes.max(initial=0)) + 1)
        length, count = _CHANGED.unpack_from(state, at)
        if length < 0:
            begin = at + _CHANGED.size
            at = begin - length
            change = decode(SurfaceChange, state[begin:at])
        known, triangles = _SHAPE.unpack_from(state, at)
        count = known if change is None else count
        rest = np.frombuffer(state, np.float32, 3 * known, at + _SHAPE.size).reshape(known, 3)
        at += _SHAPE.size + rest.nbytes
        nodes = np.frombuffer(state, np.float32, 3 * count, at).reshape(count, 3)
        at += nodes.nbytes
        faces = np.frombuffer(state, np.uint32, 3 * triangles, at).reshape(triangles, 3)
        first = SoftSurface.of_triangles(faces, known)
        surface = first if change is None else first.changed(change)
        if count != len(surface.origins):
            raise MessageError(f"{count} nodes for a surface of {len(surface.origins)}")
        self.rest, self.nodes, self.triangles = rest, nodes, faces
        self._first, self._surface, self._change = first, surface, change
        self._film = film
        return state[at + faces.nbytes :]
