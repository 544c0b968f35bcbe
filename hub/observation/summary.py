"""The progress of a run, and its summary at the end."""

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
    """Steps of the whole run; None if it continues until it is stopped."""
    sim_time_s: float
    real_time_factor: float
    late_steps: int
    live: Mapping[str, tuple[float, str]]
    """Current value and unit of each measure that is shown live and has a value yet."""


@dataclass(frozen=True)
class Observed:
    """What one observer, such as a camera in real time, has seen of a run."""

    states: int
    """That it saw; a camera has drawn a picture of each."""
    dropped: int
    """States at its period that it did not see, because it was still busy."""
    rate: float
    """States per second of wall time that it saw."""
    attainable_rate: float
    """States per second that it could have seen, by the time that one took on this machine."""
    lost: str | None
    """Why it did not see the end; None if it did."""


@dataclass(frozen=True)
class Summary:
    """The result of a run: how far and how fast it went, its state hash and its measures.

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
    """By way (`device to grant`, `grant to state`, `state to force`, `state to picture`) and stream: count,
    p50_s, p99_s, largest_s. In the device's clock: one that follows simulated time has simulated latencies.
    """
    observers: dict[str, Observed] = field(default_factory=dict[str, Observed])
    """By name, the participants that looked on in their own time."""
    measures: dict[str, float | None] = field(default_factory=dict[str, float | None])
    scores: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])
    """By participant, the last score card that it published (`hub/recording/scores.py`)."""
    ending: str | None = None
    """Which participant has ended the session, at what simulated time and why; None if none has."""
    profile: dict[str, Any] | None = None
    """Where the time went, if that was asked for (`hub/recording/profiles.py`)."""

    def as_dict(self) -> dict[str, Any]:
        """Return the summary as a flat mapping, with the measures beside the rest."""
        row = asdict(self)
        measures = row.pop("measures")
        return row | measures
