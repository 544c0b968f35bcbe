"""The suture planner's topics of the V-REP scenes of Ferro et al., as markers.

Colours, sizes and frames are those of the scripts of dVRK-suturing.ttt (unina-icaros/dvrk-vrep, 88fe5975): a
point of `suture_position_sx` is blue and marks an insertion, one of `suture_position_dx` is red and marks an
extraction; both are spheres of 1 mm. `user_position` places a disc of the needle's size. Poses are in the
remote centre of motion of PSM1. As there, `user_position_2` does nothing. The banner has letters of 6 mm; its
place in the picture is our choice.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, cast

from pydantic import Field

from hub.participant import (
    Controller,
    Inputs,
    Outputs,
    Params,
    Record,
    Setup,
    event_in,
    event_out,
    flag,
    integer,
)
from robots.dvrk.crtk import base_frame
from robots.dvrk.endoscope import BASELINE
from schemas.ports import Port
from schemas.quantity import Length
from schemas.ros import BoolMessage, Header, Point, Pose, Quaternion, StringMessage, Vector3
from schemas.visualization import ColorRGBA, Marker, MarkerAction, MarkerArray, MarkerType

__all__ = ["VrepSutures", "VrepSuturesParams"]

_PLANNER = "suture_planner"
_POINT = 1e-3
"""m; diameter of a point."""
_MOST_POINTS = 1000
"""Largest number of points of a colour; more replace the oldest, where the authors' scene stops to draw."""
_DISC, _THICKNESS = 23e-3, 0.2e-3
"""m; diameter of the disc, which is that of the needle, and its thickness, which is our choice."""
_LETTERS = 6e-3
"""m."""
_COLOURS = {
    "sx": ColorRGBA(b=1.0, a=1.0),
    "dx": ColorRGBA(r=1.0, a=1.0),
    "disc": ColorRGBA(r=0.2, g=0.8, b=1.0, a=0.4),
    "banner": ColorRGBA(r=1.0, g=0.9, b=0.2, a=1.0),
}
"""Colours of the points as in the authors' scene; the rest are our choice."""
_FIRST_WORD = "Teleoperation"


class VrepSuturesParams(Params):
    """Where the banner is."""

    open_to_pages: ClassVar[bool] = True

    camera: str = Field(default="endoscope", description="whose pictures the banner is in")
    banner: tuple[Length, Length, Length] = Field(
        default=(BASELINE / 2.0, -42e-3, 0.1),
        description="the middle of its text in the left camera's optical frame: right, down, ahead",
    )


class _State(Record):
    sx = integer()
    dx = integer()
    """How many points there were since the last deletion."""
    begun = flag()


class VrepSutures(Controller):
    """Reads the topics under `suture_planner/`, and publishes markers in three namespaces and a banner."""

    params_model: ClassVar[type[Params]] = VrepSuturesParams
    params: VrepSuturesParams

    def __init__(self, name: str, params: VrepSuturesParams) -> None:
        super().__init__(name, params)
        self._state = _State()
        self.keep(self._state)

    @property
    def ports(self) -> tuple[Port, ...]:
        """Their topics in, markers out."""
        types = {
            **dict.fromkeys(
                ("suture_position_sx", "suture_position_dx", "user_position", "user_position_2"),
                Pose.ros_type,
            ),
            "delete_stitches": BoolMessage.ros_type,
            "state_current": StringMessage.ros_type,
        }
        return (
            *(event_in(f"{_PLANNER}/{topic}", type_) for topic, type_ in types.items()),
            event_out("markers", MarkerArray, "blue and red points, disc and banner"),
        )

    def configure(self, setup: Setup) -> Outputs:  # noqa: ARG002
        """Publish nothing yet: events begin with the first step."""
        return {"markers": ()}

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Turn what the planner says into markers: a deletion first, as it is about what was there."""
        if self._state.begun and inputs.quiet:
            return {"markers": ()}
        markers = list(self._markers(inputs))
        self._state.begun = True
        return {"markers": (MarkerArray(markers=markers),) if markers else ()}

    def _markers(self, inputs: Inputs) -> Iterator[Marker]:
        if not self._state.begun:
            yield self._banner_marker(_FIRST_WORD)
        deletions = cast("tuple[BoolMessage, ...]", inputs.events(f"{_PLANNER}/delete_stitches"))
        if any(message.data for message in deletions):
            self._state.sx = self._state.dx = 0
            yield from (
                Marker(ns=f"{_PLANNER}/{side}", action=MarkerAction.DELETEALL) for side in ("sx", "dx")
            )
        for side in ("sx", "dx"):
            for pose in cast("tuple[Pose, ...]", inputs.events(f"{_PLANNER}/suture_position_{side}")):
                count = int(getattr(self._state, side))
                setattr(self._state, side, count + 1)
                yield _create_marker(
                    side, count % _MOST_POINTS, MarkerType.SPHERE, pose, (_POINT, _POINT, _POINT)
                )
        for pose in cast("tuple[Pose, ...]", inputs.events(f"{_PLANNER}/user_position")):
            yield _create_marker("disc", 0, MarkerType.CYLINDER, pose, (_DISC, _DISC, _THICKNESS))
        for text in cast("tuple[StringMessage, ...]", inputs.events(f"{_PLANNER}/state_current")):
            yield self._banner_marker(text.data)

    def _banner_marker(self, text: str) -> Marker:
        """Return the banner, or its deletion if there is no text."""
        x, y, z = self.params.banner
        return Marker(
            header=Header(frame_id=f"{self.params.camera}_left_optical"),
            ns=f"{_PLANNER}/banner",
            type=MarkerType.TEXT_VIEW_FACING,
            action=MarkerAction.ADD if text.strip() else MarkerAction.DELETE,
            pose=Pose(position=Point(x=x, y=y, z=z)),
            scale=Vector3(z=_LETTERS),
            color=_COLOURS["banner"],
            frame_locked=True,
            text=text,
        )


def _create_marker(
    what: str, number: int, kind: MarkerType, pose: Pose, size: tuple[float, float, float]
) -> Marker:
    x, y, z = size
    # a sphere looks the same however it is turned, and the planner leaves its orientation empty
    turn = Quaternion() if kind is MarkerType.SPHERE else pose.orientation
    return Marker(
        header=Header(frame_id=base_frame("PSM1")),
        ns=f"{_PLANNER}/{what}",
        id=number,
        type=kind,
        pose=Pose(position=pose.position, orientation=turn),
        scale=Vector3(x=x, y=y, z=z),
        color=_COLOURS[what],
        frame_locked=True,
    )
