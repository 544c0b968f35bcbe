"""Whole sessions from Python, as with `trocar run` and `trocar verify`, for notebooks and scripts."""

from __future__ import annotations

import json
import logging
import os
import shlex
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

from hub.hosting.numerics import pin_numerics

_environment = dict(os.environ)
pin_numerics(os.environ)  # before anything below imports numpy
_LATE = {name: value for name, value in os.environ.items() if _environment.get(name) != value}
"""Settings too late for numpy, imported before this module."""
if "numpy" not in sys.modules:
    _LATE.clear()

from hub.fork import Fork  # noqa: E402
from hub.observation.summary import Progress, Summary  # noqa: E402
from hub.planning.scenario_file import ScenarioFile, load, locate_error  # noqa: E402
from hub.recording.recording import Recording  # noqa: E402
from hub.session.launch import launch  # noqa: E402
from hub.verify import VerifySummary  # noqa: E402
from hub.verify import verify as resimulate  # noqa: E402
from schemas.errors import ScenarioError  # noqa: E402

__all__ = ["fork", "load_scenario", "run", "verify"]

log = logging.getLogger(__name__)


def load_scenario(
    scenario: str | Path,
    *,
    set: Mapping[str, Any] | None = None,  # noqa: A002  (the word of the command line)
) -> ScenarioFile:
    """Return a validated scenario: `scenario`, `params` by participant, and `source`, the file.

        trocar.load_scenario("palpation").scenario.step     # 1000000 ns

    Args:
        scenario: The name of an installed scenario, or a path ending in `.yaml`.
        set: New values by path: `{"participants.teleop.scale": 0.3}`. A text is read like `--set` of the
            command line (`"80 mm"`).

    Raises:
        ScenarioError: The scenario is not valid; a line for each problem, with file, line and column.
    """
    return load(str(scenario), _to_overrides(set))


def _to_overrides(values: Mapping[str, Any] | None) -> list[str]:
    return [
        f"{path}={value if isinstance(value, str) else json.dumps(value, default=str)}"
        for path, value in (values or {}).items()
    ]


def run(
    scenario: str | Path,
    *,
    record: str | Path | None = None,
    set: Mapping[str, Any] | None = None,  # noqa: A002  (the word of the command line)
    pace: Literal["fast", "realtime"] | None = None,
    one_host: bool = False,
    profile: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Summary:
    """Run a scenario to the end and return the summary. Call from the main thread.

        summary = trocar.run("table", set={"duration": "2 s"}, record="recordings/table")
        summary.measures["peak_hand_force_n"]     # N

    Args:
        scenario: The name of an installed scenario, or a path ending in `.yaml`.
        record: A new directory for the recording, a rosbag2 bag, to be read by `Recording(record)`.
        set: New values, as in `load_scenario`.
        pace: `fast` or `realtime`, instead of the scenario's own.
        one_host: Run every participant in this process.
        profile: Measure where the time goes: `Summary.profile`, and in the recording.
        progress: Is called several times a second of wall time.

    Raises:
        ScenarioError: The scenario is not valid, or needs a missing package.
        SessionError: The session failed; the recording is closed and can be read.
        RecordingError: `record` is not empty, or cannot be written.
    """
    file = load_scenario(scenario, set={**(set or {}), **({"pace": pace} if pace else {})})
    _warn_of_other_bits()
    try:
        to = None if record is None else Path(record)
        session = launch(file, record=to, one_host=one_host, profile=profile)
        return session.run(progress)
    except ScenarioError as error:
        raise locate_error(error, file.source) from error


def verify(
    recording: str | Path | Recording,
    *,
    trust: bool = False,
    directory: str | Path | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> VerifySummary:
    """Simulate a recorded session again from its grants and compare every state hash.

        trocar.verify("recordings/table").same     # True: the same bits

    Args:
        recording: A recording, or the path of its directory or MCAP file.
        trust: Allow the recording to run its classes, FMUs and native libraries, and to read files other than
            the recorded files.
        directory: Base of relative paths in the scenario, by default as recorded.
        progress: Is called several times a second of wall time.

    Raises:
        RecordingError: Not a recording of a session, or a damaged recording.
        TrustError: The recording needs `trust`; the message lists the reasons.
        SessionError: The session failed.
    """
    _warn_of_other_bits()
    opened = recording if isinstance(recording, Recording) else Recording(Path(recording))
    start = None if directory is None else Path(directory)
    return resimulate(opened, trust=trust, directory=start, progress=progress)


def fork(
    recording: str | Path | Recording,
    at: float,
    *,
    record: str | Path | None = None,
    set: Mapping[str, Any] | None = None,  # noqa: A002  (the word of the command line)
    trust: bool = False,
    directory: str | Path | None = None,
    one_host: bool = False,
    progress: Callable[[Progress], None] | None = None,
) -> Summary:
    """Go on from an instant of a recording; return the summary of the whole. Call from the main thread.

        trocar.fork("recordings/table", 4.0, set={"teleop.scale": 0.1}, record="recordings/slower")

    Up to the instant all is simulated again, and every state hash compared; then the devices of the scenario
    lead. The fork's own recording is complete in itself.

    Args:
        recording: A recording, or the path of its directory or MCAP file.
        at: Simulated time, s, rounded down to a communication point.
        record: A new directory for the fork's recording.
        set: Changes, as in `load_scenario`: devices, pace, duration, measures, and parameters of engines and
            controllers with saved states.
        trust: As in `verify`.
        directory: As in `verify`.
        one_host: Run every participant in this process.
        progress: Is called several times a second of wall time.

    Raises:
        ScenarioError: A change is not valid, or not possible in a running session.
        RecordingError: Not a recording of a session, or a recording without this instant.
        TrustError: The recording needs `trust`; the message lists the reasons.
        SessionError: The session failed, or its past has state hashes different from the recording.
    """
    _warn_of_other_bits()
    opened = recording if isinstance(recording, Recording) else Recording(Path(recording), unfinished=True)
    made = Fork(
        opened,
        round(at * 1e9),
        _to_overrides(set),
        record=None if record is None else Path(record),
        trust=trust,
        directory=None if directory is None else Path(directory),
        one_host=one_host,
    )
    return made.run(progress)


def _warn_of_other_bits() -> None:
    """Warn if numpy computes with different kernels in this process and in the hosts."""
    if _LATE:
        log.warning(
            "numpy was imported before trocar.run: state hashes may differ from those of the command line. To"
            " have the same, import trocar.sessions first, or start Python with %s",
            " ".join(f"{name}={shlex.quote(value)}" for name, value in _LATE.items()),
        )
