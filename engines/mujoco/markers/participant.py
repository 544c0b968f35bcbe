"""The kind `markers`: keeps what ROS programs and controllers want to see in the pictures of a scene.

The output is all shown markers, so an observing camera may miss any value.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, cast

from pydantic import Field

from engines.mujoco.markers.frames import SceneFrames, frame_names
from engines.mujoco.markers.store import MarkerStore
from engines.mujoco.params import SceneParams
from engines.mujoco.ports import position_count
from hub.participant import (
    Inputs,
    Outputs,
    Params,
    Setup,
    Stepped,
    Value,
    event_in,
    event_out,
    signal_in,
    signal_out,
    state_hash,
)
from schemas.codec import decode, encode
from schemas.errors import MessageError, MissingExtraError, StateError
from schemas.ports import Port
from schemas.quantity import Duration
from schemas.ros import StringMessage
from schemas.trocar_msgs import ShownMarkers
from schemas.vectors import Vector
from schemas.visualization import MarkerArray

if TYPE_CHECKING:
    import mujoco

__all__ = ["Markers", "MarkersParams"]

_MOST_REASONS = 8
"""Most reasons in a text: a message may have thousands of equal mistakes."""


class MarkersParams(SceneParams):
    """The scene in whose frames markers are, the same as the robot's."""

    open_to_pages: ClassVar[bool] = True

    cameras: tuple[Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$")], ...] = Field(
        default=("endoscope",),
        description="names of the cameras on the ECM, for frames `<camera>_left_optical`, as in the gateway",
    )
    publish_period: Duration = Field(
        default=20_000_000, gt=0, description="how often `shown` is published; a multiple of the period"
    )


class Markers(Stepped):
    """Markers of all sources, in one store."""

    params_model: ClassVar[type[Params]] = MarkersParams
    params: MarkersParams

    def __init__(self, name: str, params: MarkersParams) -> None:
        super().__init__(name, params)
        self._frames = frame_names(params, params.cameras)
        self._store = MarkerStore(self._frames, frozenset(), tuple(params.objects))
        self._hashed: tuple[ShownMarkers | None, int] = (None, 0)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Messages in, of any number of sources, and `qpos`; what is shown and what was rejected out."""
        size, add = (
            position_count(self.params),
            "to add, change and delete; frames: " + ", ".join(self._frames),
        )
        qpos = "joint positions of the scene, as the mujoco engine publishes them"
        period_ns, shown = self.params.publish_period, "all markers, for cameras"
        return (
            signal_in("qpos", description=qpos, size=size),
            event_in("markers", MarkerArray, add),
            signal_out("shown", ShownMarkers, shown, frame="world", period_ns=period_ns),
            event_out("error", StringMessage, "which markers were rejected, and why"),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Build the scene. Raises MissingExtraError where MuJoCo is not installed."""
        try:
            import mujoco

            from engines.mujoco.model import build
        except ImportError as error:
            raise MissingExtraError(
                f"participant '{self.name}' (kind markers)", "mujoco", error.name or "mujoco"
            ) from error
        self._model: mujoco.MjModel = build(self.params.model_copy(update={"looks": "none"}))
        self._data = mujoco.MjData(self._model)
        self._poses = SceneFrames(self.params, self._model)
        self._store = MarkerStore(self._frames, self._poses.fixed, tuple(self.params.objects))
        return self._outputs([])

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:
        """Do what the messages of this step say, by the positions at `t`."""
        reasons: list[str] = []
        if messages := cast("tuple[MarkerArray, ...]", inputs.events("markers")):
            self._move_to(inputs["qpos"])
            for message in messages:
                reasons += self._store.apply(message, t, self._pose_of)
        self._store.expire(t + h)
        return self._outputs(reasons)

    def _move_to(self, positions: Vector) -> None:
        import mujoco

        self._data.qpos[:] = positions
        mujoco.mj_kinematics(self._model, self._data)

    def _pose_of(self, frame: str) -> Vector:
        return self._poses.pose(frame, self._data)

    def _outputs(self, reasons: list[str]) -> Outputs:
        texts: tuple[StringMessage, ...] = ()
        if reasons:
            more = len(reasons) - _MOST_REASONS
            rest = f" and {more} more" if more > 0 else ""
            text = "; ".join(reasons[:_MOST_REASONS])
            texts = (StringMessage(data=f"{self.name}: {len(reasons)} rejected: {text}{rest}"),)
        outputs: dict[str, Value] = {"shown": self._store.shown, "error": texts}
        return outputs

    def state_hash(self) -> int:
        """Return the hash of all shown markers."""
        shown = self._store.shown
        if self._hashed[0] is not shown:
            self._hashed = shown, state_hash(encode(shown))
        return self._hashed[1]

    def save(self) -> bytes:
        """Return all shown markers."""
        return encode(self._store.shown)

    def restore(self, state: bytes) -> None:
        """Return to a saved state. Raises StateError if it is none of this kind."""
        try:
            self._store.restore(decode(ShownMarkers, state))
        except (MessageError, ValueError) as error:
            raise StateError(
                f"participant '{self.name}': a saved state of {len(state)} bytes has no markers: {error}; was"
                " it saved by another participant?"
            ) from error

    def close(self) -> None:
        """Do nothing: there is nothing to give back."""
