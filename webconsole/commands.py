"""Commands of a page: JSON, checked before anything is done."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from schemas.errors import MessageError

__all__ = [
    "At",
    "Command",
    "Control",
    "End",
    "Exchange",
    "Fork",
    "Hand",
    "Invite",
    "Lead",
    "Leave",
    "Network",
    "Pick",
    "Prepare",
    "Say",
    "Show",
    "Start",
    "Tune",
    "Watch",
    "command",
    "command_name",
]

MOST_BYTES = 16_384
"""Size limit of a page's message, bytes."""
_MOST_NUMBERS = 24

Finite = Annotated[float, Field(allow_inf_nan=False, ge=-1e6, le=1e6)]
Share = Annotated[float, Field(allow_inf_nan=False, ge=-1.0, le=1.0)]
Name = Annotated[str, Field(min_length=1, max_length=200)]
Scalar = (
    bool
    | Annotated[int, Field(ge=-(2**53), le=2**53)]
    | Annotated[float, Field(allow_inf_nan=False)]
    | Annotated[str, Field(max_length=100)]
    | None
)
"""A value of JSON without parts."""


class _Command(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Show(_Command):
    """Contents of this page beside the scene."""

    do: Literal["show"]
    numbers: Annotated[list[Name], Field(max_length=_MOST_NUMBERS)] = []
    pictures: bool = True
    again: bool = False
    """Send everything again: this page has only now loaded the scene."""


class At(_Command):
    """The instant of a recording, or of the running session's past, to show."""

    do: Literal["at"]
    time: Finite | None
    """Simulated time, s; None: the present."""


class Control(_Command):
    """Steer the running session."""

    do: Literal["pause", "resume", "step", "stop"]
    steps: Annotated[int, Field(ge=1, le=1_000_000)] = 1


class Network(_Command):
    """Change the emulated network between a device and the hub."""

    do: Literal["network"]
    device: Name
    delay: Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=10.0)] | None = None
    """Delay in each direction, s; for all three values None leaves the present value."""
    jitter: Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=10.0)] | None = None
    """Largest additional delay of a message, s."""
    loss: Annotated[float, Field(allow_inf_nan=False, ge=0.0, lt=1.0)] | None = None
    """Share of the messages."""


class Tune(_Command):
    """Change a parameter of the running session."""

    do: Literal["tune"]
    name: Name
    """`participant.port`."""
    value: Finite
    """New value, in the unit of the port."""


class Watch(_Command):
    """Show another session."""

    do: Literal["watch"]
    session: Name


class Invite(_Command):
    """Make a link for another browser."""

    do: Literal["invite"]
    role: Literal["viewer", "operator"]


class _Begun(_Command):
    """A session in a new process."""

    changes: Annotated[dict[Name, Scalar], Field(max_length=50)] = {}
    """New values by their path: `duration`, or participant and parameter, `teleop.scale`."""
    lead: Annotated[list[Name], Field(max_length=8)] = []
    """Devices led from pages from then on."""
    pace: Literal["fast", "realtime"] | None = None
    record: bool = True


class Prepare(_Command):
    """Have processes ready: the form of a new session or of a fork is open."""

    do: Literal["prepare"]


class Start(_Begun):
    """Start an installed scenario."""

    do: Literal["start"]
    scenario: Name


class Fork(_Begun):
    """Go on from an instant of the recording."""

    do: Literal["fork"]
    time: Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=1e6)]
    """Simulated time, s."""
    duration: Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1e6)] | None = None
    """Simulated time of the session's end, s; None: as in the recording."""


class End(_Command):
    """End a session started from a page."""

    do: Literal["end"]
    number: Annotated[int, Field(ge=1, le=1_000_000)]


class Lead(_Command):
    """Become the pilot of a device."""

    do: Literal["lead"]
    device: Name
    beside: bool = False
    """Go on leading this page's other devices: a head, and two hands."""


class Exchange(_Command):
    """Ask for an instrument, for the arm of a device led by this page."""

    do: Literal["exchange"]
    device: Name
    instrument: Name
    """Name in the dVRK's words, as in the session's description."""


class Leave(_Command):
    """Lead no more."""

    do: Literal["leave"]


class Hand(_Command):
    """Wish of keys, sticks and pointer for the device led by this page."""

    do: Literal["hand"]
    number: Annotated[int, Field(ge=0, lt=2**53)]
    """Number of the input, counted up: an older input is refused."""
    linear: tuple[Share, Share, Share] = (0.0, 0.0, 0.0)
    """Ahead, left, up, each a share of the greatest speed."""
    angular: tuple[Share, Share, Share] = (0.0, 0.0, 0.0)
    """Shares about the stylus' own x (the point moves up), y (right) and z (as a screw going in)."""
    turn: tuple[Share, Share, Share] = (0.0, 0.0, 0.0)
    """Shares about the axes ahead, left, up of the hand's frame."""
    drag: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)
    """Way of the pointer since this page leads, m: ahead, left, up."""
    gripper: Share = 0.0
    """1 opens, -1 closes."""
    dead_man: bool = False
    jaw: bool = False
    pedal: bool = False
    rinse: bool = False
    away: bool = False
    """Whether the page is no longer in front: its last input."""
    device: Name | None = None
    """The device, where this page leads several."""
    tracked: tuple[Finite, Finite, Finite, Finite, Finite, Finite, Finite] | None = None
    """Where a headset has the head or a hand, in place of shares: position (m) and quaternion (x, y, z, w),
    along the axes of WebXR (x right, y up, z towards the user)."""


class Pick(_Command):
    """A point clicked by a person in a picture: where a needle goes in, say."""

    do: Literal["pick"]
    picture: Name
    """Name of the picture in the session's description."""
    x: Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=1e5)]
    """To the right, in pixels of the picture."""
    y: Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=1e5)]
    """Down."""


class Say(_Command):
    """A word to the guided participant: `pause`, `consent` with the name of a proposal, and others."""

    do: Literal["say"]
    word: Annotated[str, Field(pattern=r"^[a-z][a-z0-9 ]{0,30}$")]


Command = Annotated[
    Show
    | At
    | Control
    | Network
    | Tune
    | Watch
    | Invite
    | Prepare
    | Start
    | Fork
    | End
    | Lead
    | Exchange
    | Leave
    | Hand
    | Pick
    | Say,
    Field(discriminator="do"),
]
_COMMANDS: TypeAdapter[Command] = TypeAdapter(Command)


class _Asked(BaseModel):
    do: Annotated[str, Field(max_length=20)] = ""


def command_name(text: str) -> str:
    """Return the `do` of a message of any content; empty without `do`."""
    try:
        return _Asked.model_validate_json(text).do
    except ValidationError:
        return ""


def command(text: str) -> Command:
    """Return the command in a message of a page; raises MessageError if the command is not valid."""
    if len(text) > MOST_BYTES:
        raise MessageError(f"a command of {len(text)} characters, at most {MOST_BYTES} are allowed")
    try:
        return _COMMANDS.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(map(str, first["loc"]))
        raise MessageError(f"not a command: {where[:100]}: {first['msg'][:200]}") from error
