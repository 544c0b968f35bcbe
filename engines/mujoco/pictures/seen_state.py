"""What cameras see of a session at one instant: positions of joints, soft bodies and markers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from engines.mujoco.markers.store import ShownMarker, shown_markers
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.soft_body import SoftBody
from engines.mujoco.ports import position_count
from hub.participant import Inputs
from schemas.codec import decode, encode
from schemas.errors import MessageError, StateError
from schemas.trocar_msgs import ShownMarkers

__all__ = ["SeenState"]


class SeenState:
    """The newest instant."""

    def __init__(self, params: EndoscopeParams) -> None:
        self._has_markers = params.markers
        self.positions = np.zeros(position_count(params))
        """Positions of the joints of the scene, shape (nq,)."""
        self.bodies = {organ: SoftBody(f"{organ}/nodes") for organ in params.soft_bodies}
        self._shown: ShownMarkers | None = None

    @property
    def markers(self) -> Sequence[ShownMarker]:
        """All markers to be drawn."""
        return () if self._shown is None else tuple(shown_markers(self._shown))

    def accept(self, inputs: Inputs) -> None:
        """Take the newest inputs.

        Raises SessionError if a soft body is not what it was, or its surface unknown.
        """
        self.positions[:] = inputs["qpos"]
        for organ, body in self.bodies.items():
            change = inputs.message(f"{organ}/surface") if body.may_change else None
            film = inputs.message(f"{organ}/film") if body.may_be_wet else None
            body.accept(inputs.message(f"{organ}/nodes"), change, film)
        if self._has_markers:
            shown = inputs.message("markers")
            self._shown = shown if isinstance(shown, ShownMarkers) else None

    def save(self) -> bytes:
        """Return positions, soft bodies and markers."""
        bodies = b"".join(body.save() for body in self.bodies.values())
        markers = b"" if self._shown is None else encode(self._shown)
        return self.positions.tobytes() + bodies + markers

    def restore(self, state: bytes) -> None:
        """Return to a saved instant. Raises StateError if it does not fit this scene."""
        size, rest = self.positions.nbytes, state[self.positions.nbytes :]
        for body in self.bodies.values():
            rest = body.restore(rest)
        shown = None
        if self._has_markers and rest:
            shown, rest = _restored_markers(rest), b""
        if len(state) < size or rest:
            raise StateError(
                f"a saved state of {len(state)} bytes does not fit; was it saved by another scene?"
            )
        self.positions[:] = np.frombuffer(state, np.float64, self.positions.size)
        self._shown = shown


def _restored_markers(state: bytes) -> ShownMarkers:
    try:
        return decode(ShownMarkers, state)
    except MessageError as error:
        raise StateError(f"a saved state with markers that cannot be read: {error}") from error
