"""The progress of a run, and the summary at the end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

__all__ = ["Observed", "Progress", "Summary"]


@dataclass(frozen=True)
class Progress:
    """The contents of a progress line."""

    step: int
    steps: int | None
    """Steps of the whole run; None for a run without an end."""
    sim_time_s: float
    real_time_factor: float
    late_steps: int
    live: Mapping[str, tuple[float, str]]
    """Current value and unit of each live measure with a value."""


@dataclass(frozen=True)
class Observed:
    """The view of a run by an observer, such as a camera in real time."""

    states: int
    """Number of states seen; a camera has drawn a picture of each."""
    dropped: int
    """States due at the observer's period but missed, because the observer was still busy."""
    rate: float
    """States seen per second of wall time."""
    attainable_rate: float
    """Attainable states per second, from the time of a state on this machine."""
    lost: str | None
    """Why the observer missed the end; None if it did not."""


@dataclass(frozen=True)
class Summary:
    """The result of a run: progress and speed, state hash and measures.

    Examples:
        summary = trocar.run("table")
        summary.sim_time_s, summary.real_time_factor, summary.measures["peak_hand_force_n"]
    """

    session: str
    state: str
    steps: int
    sim_time_s: float
    wall_time_s: float
    real_time_factor: float
    late_steps: int
    dropped_messages: int
    state_hash: str
    """Hash of all state hashes: equal for equal runs, whatever the hosts and the windows of the grants."""
    recording: str | None
    recording_complete: bool | None
    energy_residual_j: float
    latency: dict[str, dict[str, dict[str, float]]] = field(
        default_factory=dict[str, dict[str, dict[str, float]]]
    )
    """Count, p50_s, p99_s and largest_s by way (`device to grant`, `grant to state`, `state to force`, `state
    to picture`) and stream. Times are in the device's clock: simulated for a device in simulated time.
    """
    observers: dict[str, Observed] = field(default_factory=dict[str, Observed])
    """The participants that looked on in their own time, by name."""
    outcome: str = ""
    """What was done, as scenario or task state the result; empty if neither does."""
    succeeded: bool | None = None
    """Whether scenario or task count the run as a success; None if neither has conditions."""
    measures: dict[str, float | None] = field(default_factory=dict[str, float | None])
    missing: dict[str, str] = field(default_factory=dict[str, str])
    """Why each measure without a value has none."""
    units: dict[str, str] = field(default_factory=dict[str, str])
    """Unit of each measure with a unit."""
    scores: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])
    """The last published score card by participant (`hub/recording/scores.py`)."""
    warnings: dict[str, str] = field(default_factory=dict[str, str])
    """What a participant could not do as asked, and from when, by participant: a camera without its looks."""
    ending: str | None = None
    """Participant, simulated time and reason of an end by a participant; else None."""
    profile: dict[str, Any] | None = None
    """Where the time went, if asked for (`hub/recording/profiles.py`)."""

    def as_dict(self) -> dict[str, Any]:
        """Return the summary as a flat mapping, with the measures beside the rest."""
        row = asdict(self)
        measures = row.pop("measures")
        return row | measures
