"""Choice of the recorded numbers for state and action of a data set, and their values at the frames."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schemas.errors import RecordingError, did_you_mean
from trocar import Recording, Series

__all__ = ["Columns", "choose_columns", "commanded_columns", "measured_columns"]

_MEASURED = re.compile(r"([A-Za-z0-9]+)/(?:(jaw|hand)/)?measured_js")
"""A port with measured joints: arm, and part of the arm. Setup joints do not match, nor do phalanges."""
_BEST = ("motion", "mujoco")
"""Preferred kinds if several participants publish the joints of an arm: the controller, else the simulator,
else the first.
"""


@dataclass(frozen=True)
class Columns:
    """Numbers of a recorded port for columns of a data set."""

    port: str
    names: tuple[str, ...]
    times_ns: NDArray[np.int64]
    """Shape (n,), ascending."""
    values: NDArray[np.float64]
    """Shape (n, len(names)); rad, m and further units of the port."""

    def at(self, times_ns: NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the newest values up to each of `times_ns`, shape (k,), as shape (k, len(names))."""
        newest = np.searchsorted(self.times_ns, times_ns, side="right") - 1
        return self.values[newest.clip(min=0)].astype(np.float32)


def measured_columns(recording: Recording) -> list[Columns]:
    """Return the measured joints of each arm, with jaw or hand, arms in alphabetical order.

    Raises RecordingError if there is none.
    """
    found = [
        _joints(recording, f"{participant}.{port}", arm, part)
        for participant, port, arm, part in _measured_ports(recording)
    ]
    if not found:
        raise RecordingError(
            f"'{recording.file}': no measured joints of an arm are recorded (a port such as"
            f" robot.PSM1/measured_js); name ports with --state and --action.{did_you_mean('', recording)}"
        )
    return found


def commanded_columns(recording: Recording) -> list[Columns]:
    """Return the commanded joints of each arm, in the order of `measured_columns`.

    Columns are the arm's setpoints; without setpoints, the commands from the arm's connection. Joints
    without a command have no columns. Raises RecordingError if nothing is commanded.
    """
    sources = {
        f"{one.target}.{one.target_port}": f"{one.source}.{one.source_port}"
        for one in (*recording.plan().connections, *recording.plan().from_devices)
    }
    found: list[Columns] = []
    for participant, port, arm, part in _measured_ports(recording):
        base = f"{participant}.{port.removesuffix('measured_js')}"
        for source in (f"{base}setpoint_js", sources.get(f"{base}servo_jp")):
            if source is not None and source in recording and len(recording[source]):
                found.append(_joints(recording, source, arm, part))
                break
    if not found:
        raise RecordingError(f"'{recording.file}': no joints are commanded; name ports with --action")
    return found


def choose_columns(recording: Recording, names: Sequence[str]) -> list[Columns]:
    """Return the numbers of `PORT` or `PORT.FIELD`, such as `tissue.probe/wrench.force`.

    Raises RecordingError for a port or a field not recorded or without numbers.
    """
    return [_choose_port(recording, name) for name in names]


def _measured_ports(recording: Recording) -> Iterator[tuple[str, str, str, str]]:
    """Yield participant, port, arm and part of each port with measured joints taken."""
    kinds = {name: spec.kind for name, spec in recording.scenario().participants.items()}
    found: dict[tuple[str, str], tuple[int, str, str]] = {}
    for name in recording.ports:
        participant, _, port = name.partition(".")
        match, kind = _MEASURED.fullmatch(port), kinds.get(participant, "")
        if match is not None and len(recording[name]):
            rank = _BEST.index(kind) if kind in _BEST else len(_BEST)
            key = match[1], match[2] or ""
            found[key] = min(found.get(key, (rank, participant, port)), (rank, participant, port))
    for (arm, part), (_, participant, port) in sorted(found.items()):
        yield participant, port, arm, part


def _joints(recording: Recording, port: str, arm: str, part: str) -> Columns:
    series = recording[port]
    values = series["position"]
    names = series.names or tuple(str(i) for i in range(values.shape[1]))
    prefix = f"{arm}.hand" if part == "hand" else arm
    return _columns(recording, series, tuple(f"{prefix}.{name}" for name in names), values)


def _choose_port(recording: Recording, name: str) -> Columns:
    for port in recording.ports:
        if name == port or name.startswith(f"{port}."):
            series, field = recording[port], name.removeprefix(port).removeprefix(".")
            values = (series[field] if field else series.values).reshape(len(series), -1)
            names = [
                one for one in series.columns if not field or one == field or one.startswith(f"{field}.")
            ]
            return _columns(recording, series, tuple(f"{port}.{one}" for one in names), values)
    raise RecordingError(f"'{recording.file}' has no port '{name}'.{did_you_mean(name, recording)}")


def _columns(
    recording: Recording, series: Series, names: tuple[str, ...], values: NDArray[np.float64]
) -> Columns:
    if not np.isfinite(values).all():
        raise RecordingError(f"'{recording.file}': not all numbers of '{series.name}' are finite")
    return Columns(series.name, names, np.round(series.time * 1e9).astype(np.int64), values)
