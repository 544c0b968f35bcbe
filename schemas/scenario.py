"""The scenario: the file that describes a session.

All quantities are SI after validation, times integer nanoseconds.
"""

from __future__ import annotations

from string import Formatter
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from schemas.keys import valid_name, valid_session_name
from schemas.network_link import NetworkLinkSpec
from schemas.quantity import Duration

__all__ = [
    "MAX_NAME",
    "Bond",
    "Connection",
    "Limits",
    "Measure",
    "Outcome",
    "ParticipantSpec",
    "PortReference",
    "Scenario",
]

Algorithm = Literal["impulse", "impulse-linearised", "gauss-seidel", "jacobi"]


MAX_NAME = 64
"""Characters: names become parts of keys, of ROS topics and of the names of files."""


def _of_allowed_length(value: str) -> str:
    if len(value) > MAX_NAME:
        raise ValueError(f"a name of {len(value)} characters; at most {MAX_NAME} are allowed")
    return value


def _name(value: str) -> str:
    if not valid_name(_of_allowed_length(value)):
        raise ValueError(f"'{value}' is no name: a letter, then letters, digits and underscores")
    return value


def _session_name(value: str) -> str:
    if not valid_session_name(_of_allowed_length(value)):
        raise ValueError(f"'{value}' is no name: a letter, then letters, digits, hyphens and underscores")
    return value


Name = Annotated[str, AfterValidator(_name)]
SessionName = Annotated[str, AfterValidator(_session_name)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class PortReference(_Part):
    """`participant.port`."""

    participant: str
    port: str

    @model_validator(mode="before")
    @classmethod
    def _parse_text(cls, value: Any) -> Any:
        if isinstance(value, str):
            participant, dot, port = value.strip().partition(".")
            if not (dot and participant and port):
                raise ValueError(f"'{value}' is no 'participant.port'")
            return {"participant": participant, "port": port}
        return value

    def __str__(self) -> str:
        return f"{self.participant}.{self.port}"


class ParticipantSpec(_Part):
    """A participant: its kind, host, period and network link, and the parameters of its kind."""

    model_config = ConfigDict(extra="allow", frozen=True)

    kind: str = Field(description="name of an installed engine, controller or device")
    host: Name = Field(default="hub", description="'hub', the name of a process to start here, or 'remote'")
    period: Duration | None = Field(
        default=None,
        description=(
            "a multiple of the step; default: the step. Of a device that lives in wall time: how often it is"
            " read; default: 1 ms"
        ),
    )
    network_link: NetworkLinkSpec | None = Field(
        default=None, description="of a device: the emulated network between it and the hub; default: none"
    )
    rate_limit: float = Field(
        default=2000.0,
        gt=0.0,
        allow_inf_nan=False,
        description=(
            "of a device: messages per second that the hub accepts from each of its ports, except in bursts"
        ),
    )
    RESERVED: ClassVar[tuple[str, ...]] = ("kind", "host", "period", "network_link", "rate_limit")

    @property
    def params(self) -> dict[str, Any]:
        """The parameters of the kind, unvalidated."""
        return dict(self.model_extra or {})


class Connection(_Part):
    """An output port feeds an input port: `source -> target`.

    `motion.drive/* -> robot.*` stands for one connection from each output of `motion` under `drive/` to the
    input of the same name of `robot`; outputs without such an input stay unconnected.
    """

    source: PortReference
    target: PortReference
    extrapolation: Literal["hold", "linear"] = "hold"

    @model_validator(mode="before")
    @classmethod
    def _parse_text(cls, value: Any) -> Any:
        if isinstance(value, str):
            source, arrow, target = value.partition("->")
            if not arrow:
                raise ValueError(f"'{value}' is no 'participant.port -> participant.port'")
            return {"source": source.strip(), "target": target.strip()}
        return value

    @model_validator(mode="after")
    def _check_wildcard(self) -> Connection:
        stars = [end.port.count("*") for end in (self.source, self.target)]
        if any(stars) and not (
            stars == [1, 1] and self.source.port.endswith("*") and self.target.port.endswith("*")
        ):
            raise ValueError(
                f"'{self.source} -> {self.target}': a wildcard is one '*' at the end of both ports"
            )
        return self

    @property
    def is_wildcard(self) -> bool:
        """Whether this stands for several connections."""
        return self.source.port.endswith("*")


class Bond(_Part):
    """A power bond: pose and twist in one direction, wrench in the other."""

    motion: PortReference
    force: PortReference
    algorithm: Algorithm = "impulse"
    prediction: Literal["velocity", "slope"] = Field(
        default="velocity",
        description="for impulse: held velocity, or with its slope (smooth linear couplings only)",
    )
    order: list[str] | None = Field(
        default=None, description="for gauss-seidel: the two participants in the order they step"
    )
    check: Literal["refuse", "warn"] = Field(
        default="refuse", description="what to do if the stable-step rule is broken"
    )

    @property
    def name(self) -> str:
        """Name of the bond in books and messages: `motion participant/bond`."""
        return f"{self.motion.participant}/{self.motion.port}"


class Measure(_Part):
    """A number for the summary, from the values of `participant.port` or `participant.port.field`."""

    kind: Literal["peak-norm", "peak", "least", "mean", "final", "drop", "swing", "time-above"] = Field(
        description=(
            "drop: the largest fall after the peak; swing: the largest minus the least value, and of several"
            " numbers, the one that varies most; time-above: the longest time (s) at `level` or above. All"
            " others take the norm of several numbers"
        )
    )
    of: PortReference
    after: Duration = Field(default=0, ge=0, description="simulated time before which values are ignored")
    level: float | None = Field(default=None, description="for time-above, in the unit of the port")
    unit: str = Field(default="", description="default for time-above: s")
    live: bool = Field(default=False, description="show the current value in the progress line")

    @property
    def si_unit(self) -> str:
        """Unit of the result; empty for a number without a unit."""
        return self.unit or ("s" if self.kind == "time-above" else "")

    @model_validator(mode="after")
    def _check_level(self) -> Self:
        if (self.level is not None) != (self.kind == "time-above"):
            raise ValueError(
                f"measure of kind {self.kind}: a level is required for time-above, and not allowed otherwise"
            )
        return self


class Limits(_Part):
    """Limits of a measure, in its unit."""

    least: float | None = None
    most: float | None = None

    def allow(self, value: float) -> bool:
        """Return whether `value` is within the limits."""
        return (self.least is None or value >= self.least) and (self.most is None or value <= self.most)


class Outcome(_Part):
    """The sentence of the summary about the result, and the conditions of success."""

    text: str = Field(
        min_length=1, description="what was done; `{name}` stands for the measure of that name, with its unit"
    )
    success: dict[Name, Limits] = Field(
        default={}, description="the limits of measures that make a run a success; default: no verdict"
    )

    @property
    def parts(self) -> list[tuple[str, str | None]]:
        """Literal texts, each with the name of the measure after it; None after the last.

        Raises ValueError for a text with a single brace.
        """
        return [(literal, name) for literal, name, _, _ in Formatter().parse(self.text)]

    @property
    def measures(self) -> set[str]:
        """Names of all measures in text and success."""
        return {name for _, name in self.parts if name is not None} | self.success.keys()


def _without_none(value: Any) -> Any:
    return {} if value is None else value


class Scenario(_Part):
    """A whole session."""

    name: SessionName
    description: str = ""
    step: Duration = Field(gt=0, description="communication step H")
    duration: Duration | None = Field(
        default=None, gt=0, description="simulated time; default: the session runs until it is stopped"
    )
    pace: Literal["fast", "realtime"] = "fast"
    window: int | None = Field(
        default=None,
        ge=1,
        le=1000,
        description=(
            "most steps that one grant may cover; default: 10 ms at pace fast with one host, else one step"
        ),
    )
    algorithm: Literal["gauss-seidel", "jacobi"] = Field(
        default="gauss-seidel", description="for connections that belong to no bond"
    )
    order: list[str] | None = Field(
        default=None,
        description="the order in which participants step; required if connections form a cycle",
    )
    answer_limit: Duration = Field(
        default=10**10,
        gt=0,
        description=(
            "time after which a participant that does not answer ends the session; on Linux without time for"
            " which its host waits for a processor"
        ),
    )
    join_limit: Duration = Field(
        default=60 * 10**9,
        gt=0,
        description="time to wait for all participants to join, counted as `answer_limit`",
    )
    scene: dict[str, Any] = Field(
        default={},
        exclude=True,
        description=(
            "parameters stated once, such as arms, mounting, table and objects: every participant gets those"
            " that its kind has; its own values have priority, and null keeps a parameter of the scene out"
        ),
    )
    participants: dict[Name, ParticipantSpec] = Field(min_length=1)
    connections: Annotated[list[Connection], BeforeValidator(lambda v: [] if v is None else v)] = []
    bonds: Annotated[list[Bond], BeforeValidator(lambda v: [] if v is None else v)] = []
    measure: Annotated[dict[Name, Measure], BeforeValidator(_without_none)] = {}
    outcome: Outcome | None = Field(
        default=None, description="what the summary says first; default: the goals of the task, if it has one"
    )

    @model_validator(mode="after")
    def _check_outcome(self) -> Self:
        if unknown := sorted(self.outcome.measures - self.measure.keys()) if self.outcome else []:
            known = ", ".join(self.measure) or "none"
            raise ValueError(f"outcome: there is no measure '{unknown[0]}'; known: {known}")
        return self
