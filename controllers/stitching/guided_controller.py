"""The guided stitch as a participant: points and words of a person in, commands and pictures out."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar, cast

import numpy as np
from pydantic import Field

from controllers.stitching import path_markers
from controllers.stitching.guided_ports import SOURCES, guided_ports
from controllers.stitching.guided_surgeon import GuidedSurgeon
from controllers.stitching.params import StitchParams
from controllers.stitching.scene_frames import SceneFrames
from controllers.stitching.stage import Stage
from controllers.stitching.two_hands import TwoHands
from hub.participant import Inputs, Outputs, Params, Record, Setup, array, integer
from robots.dvrk import endoscope
from robots.dvrk.endoscope import BASELINE, StereoCamera
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.errors import MotionError
from schemas.ports import Port
from schemas.quantity import Angle, Length
from schemas.ros import BoolMessage, PointStamped, StringMessage
from schemas.visualization import Marker, MarkerArray

__all__ = ["GuidedStitching", "GuidedStitchingParams"]

_FIRST_WORDS = "Pick entry and exit"


class GuidedStitchingParams(StitchParams):
    """The scene, the two hands, and the camera that shows the stitch."""

    open_to_pages: ClassVar[bool] = True

    camera: str = Field(default="endoscope", description="whose pictures the banner is in")
    width: int = Field(default=endoscope.WIDTH, ge=1, description="of its pictures, in pixels")
    height: int = Field(default=endoscope.HEIGHT, ge=1, description="of its pictures, in pixels")
    field_of_view: Angle = Field(
        default=endoscope.FIELD_OF_VIEW, gt=0.0, lt=3.0, description="of it, horizontal"
    )
    baseline: Length = Field(default=BASELINE, ge=0.0, description="between its two eyes")
    banner: tuple[Length, Length, Length] = Field(
        default=(BASELINE / 2.0, -42e-3, 0.1),
        description="the middle of its text in the left camera's optical frame: right, down, ahead",
    )


class _Shown(Record):
    stage = array(1)
    published = integer(-1)
    """Stage of the last `state`."""
    picked = integer(-1)
    """Number of points drawn."""
    led = array(2)
    """Whether a person's hand leads driver and puller."""


class GuidedStitching(TwoHands):
    """Makes the stitches picked by a person, in turn, each with the person's consent."""

    params_model: ClassVar[type[Params]] = GuidedStitchingParams
    params: GuidedStitchingParams

    def __init__(self, name: str, params: GuidedStitchingParams) -> None:
        super().__init__(name, params)
        self._surgeon = GuidedSurgeon(params, *self._hands)
        self._seen = _Shown()
        self.publish(self._surgeon, self._surgeon.guided, self._seen)
        self._camera, self._banner = params.camera, params.banner
        seen = StereoCamera(params.width, params.height, params.field_of_view, params.baseline)
        self._frames = SceneFrames(params, params.camera, seen)
        self._outputs |= {"stage": self._seen.stage, "state": (), "markers": ()}

    @property
    def ports(self) -> tuple[Port, ...]:
        """Ports of the expert; setpoints, points and words in; stage and markers out."""
        return (*guided_ports(self._hands, self._needle), *self._frames.ports)

    def configure(self, setup: Setup) -> Outputs:
        """Start with idle hands."""
        self._period = setup.period_ns * 1e-9
        return super().configure(setup)

    def step(self, t: int, h: int, inputs: Inputs) -> Outputs:  # noqa: ARG002
        """Hear the person, and advance the stitch with consent.

        Raises SessionError if a command is refused.
        """
        surgeon, seen = self._surgeon, self._seen
        setpoints = np.zeros((2, 7))
        for hand in self._hands:
            hand.period = self._period
        surgeon.sure = self._sense(self._surgeon, inputs)
        for number, hand in enumerate(self._hands):
            setpoints[number] = matrix_to_pose(
                hand.base @ pose_to_matrix(inputs[f"{hand.arm}/local/setpoint_cp"])
            )
            for message in cast("tuple[BoolMessage, ...]", inputs.events(f"{hand.arm}/following")):
                seen.led[number] = message.data
        surgeon.measure(setpoints, led=bool(seen.led.any()))
        said = [*self._hear_person(inputs)]
        surgeon.step()
        self._command()
        said += surgeon.statuses()
        self._outputs["status"] = tuple(StringMessage(data=text) for text in said)
        self._show(said)
        return self._outputs

    def _hear_person(self, inputs: Inputs) -> Iterator[str]:
        """Execute the points and words of the person; yield what each led to, refusals included."""
        surgeon = self._surgeon
        for source in SOURCES:
            for picked in cast("tuple[PointStamped, ...]", inputs.events(f"{source}pick")):
                try:
                    surgeon.pick(self._frames.in_world(picked, inputs))
                except MotionError as error:
                    yield f"refused: {error}"
                yield from surgeon.statuses()
            for command in cast("tuple[StringMessage, ...]", inputs.events(f"{source}command")):
                try:
                    surgeon.command(command.data)
                except MotionError as error:
                    yield f"refused: {error}"
                yield from surgeon.statuses()

    def _command(self) -> None:
        surgeon, moves = self._surgeon, self._surgeon.moves_arms
        for hand, settles in zip(self._hands, surgeon.settles, strict=True):
            self._outputs[f"{hand.arm}/servo_cp"] = (hand.advance(settle=settles),) if moves else ()
            self._outputs[f"{hand.arm}/jaw/move_jp"] = hand.jaw_commands() if moves else ()
        self._shown.phase[0], self._shown.stitch[0] = surgeon.state.phase, surgeon.state.made[0] + 1.0

    def _show(self, said: list[str]) -> None:
        """Publish the stage and the changed markers."""
        guided, seen, params = self._surgeon.guided, self._seen, self.params
        stage, markers = guided.stage, list[Marker]()
        self._outputs["state"] = (StringMessage(data=stage.name),) if seen.published != stage else ()
        if seen.published < 0:
            said = [_FIRST_WORDS]
        if said:
            markers.append(path_markers.banner_marker(said[-1], self._camera, self._banner))
        if seen.picked != guided.picked or seen.published != stage:
            pose = params.phantom.pose
            for number, place in enumerate(guided.points):
                there = (pose @ [*place, 1.0])[:3] if number < guided.picked else None
                markers.append(path_markers.point_marker(number, there))
            planned = stage is not Stage.PICKING and guided.picked == len(guided.points)
            markers += path_markers.path_markers(self._surgeon.stitch if planned else None, params.emerge)
        seen.picked, seen.published, seen.stage[0] = guided.picked, int(stage), stage
        self._outputs["markers"] = (MarkerArray(markers=markers),) if markers else ()
