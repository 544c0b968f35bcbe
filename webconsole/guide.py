"""Work guided by a person from a page: points picked in a picture, and words of consent.

A participant can be guided if nothing but a person's hand writes the inputs `operator/pick` and
`operator/command`, as with `guided-stitching`. A pixel is a point in the frame `<camera>_<eye>_image`, x to
the right and y down; the participant finds the point of the scene under the pixel.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from hub.planning.plan import Plan
from hub.transport.control_messages import SetRequest
from schemas.codec import decode
from schemas.errors import MessageError
from schemas.ros import Float64Message, PointStamped, StringMessage
from webconsole.commands import Pick, Say
from webconsole.source import Value

__all__ = ["GuidedWork", "guide_request", "guided_participant"]

_PICK, _COMMAND = "operator/pick", "operator/command"
_TYPES = {_PICK: PointStamped.ros_type, _COMMAND: StringMessage.ros_type}
_EYES = ("left", "right")


def guided_participant(plan: Plan) -> str | None:
    """Return the first participant guided by a person; None without such a participant."""
    for name, planned in plan.participants.items():
        inputs = {port.name: port.type for port in planned.ports if port.causality == "input"}
        if _TYPES.items() <= inputs.items():
            return name
    return None


def guide_request(participant: str | None, order: Pick | Say) -> SetRequest:
    """Return the request to the hub; raises MessageError if nothing is guided, or no such picture."""
    if participant is None:
        raise MessageError("nothing in this session is guided by a person")
    if isinstance(order, Say):
        return SetRequest(participant=participant, port=_COMMAND, value={"data": order.word})
    camera, _, port = order.picture.partition(".")
    eye = port.partition("/")[0]
    if eye not in _EYES:
        raise MessageError(f"'{order.picture}' is no picture of an eye")
    point = {
        "header": {"frame_id": f"{camera}_{eye}_image"},
        "point": {"x": order.x, "y": order.y, "z": 0.0},
    }
    return SetRequest(participant=participant, port=_PICK, value=point)


class GuidedWork(NamedTuple):
    """The outputs of a guided participant for its person, as of `guided-stitching`."""

    participant: str

    @property
    def stage(self) -> str:
        """The outlet with the number of the stage."""
        return f"{self.participant}.stage"

    @property
    def status(self) -> str:
        """The outlet with the words to the person; pictures show them cut short."""
        return f"{self.participant}.status"

    def as_json(self, stage: Value | None, status: Value | None) -> dict[str, Any]:
        """Return stage and words, ready for JSON; raises MessageError for an invalid value."""
        return {
            "stage": None if stage is None else decode(Float64Message, stage.payload).data,
            "said": "" if status is None else decode(StringMessage, status.payload).data,
        }
