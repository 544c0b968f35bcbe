"""Whole sessions from Python: what `trocar run` and `trocar verify` do, for notebooks and scripts."""

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
"""Settings that numpy did not see, as it had been imported before this module."""
if "numpy" not in sys.modules:
    _LATE.clear()

from hub.fork import Fork  # noqa: E402
from hub.observation.summary import Progress, Summary  # noqa: E402
from hub.planning.scenario_file import ScenarioFile, load, located  # noqa: E402
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
    """Return a validated scenario: `scenario`, `params` by participant, and `source`, its file.

        trocar.load_scenario("palpation").scenario.step     # 1000000 ns

    Args:
        scenario: The name of an installed scenario, or a path with its `.yaml`.
        set: Values that replace those of the file, by their path: `{"participants.teleop.scale": 0.3}`. A
            text is read as `--set` of the command line reads it (`"80 mm"`).

    Raises:
        ScenarioError: The scenario is not valid; one line for each problem, with file, line and column.
    """
    return load(str(scenario), _overrides(set))


def _overrides(values: Mapping[str, Any] | None) -> list[str]:
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
    """Run a scenario to its end and return its summary. Call it in the main thread.

        summary = trocar.run("table", set={"duration": "2 s"}, record="recordings/table")
        summary.measures["peak_hand_force_n"]     # N

    Args:
        scenario: The name of an installed scenario, or a path with its `.yaml`.
        record: A new directory for the recording, a rosbag2 bag; `Recording(record)` reads it.
        set: Values that replace those of the file, as in `load_scenario`.
        pace: `fast` or `realtime`, instead of the scenario's own.
        one_host: Run every participant in this process.
        profile: Measure where the time goes: `Summary.profile`, and in the recording.
        progress: Is called several times a second of wall time.

    Raises:
        ScenarioError: The scenario is not valid, or a package that it needs is not installed.
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
        raise located(error, file.source) from error


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
        trust: Allow it to run classes, FMUs and native libraries that it names, and to read files other than
            those it was recorded with.
        directory: Where relative paths of its scenario start, by default where they did.
        progress: Is called several times a second of wall time.

    Raises:
        RecordingError: Not a recording of a session, or a damaged one.
        TrustError: It asks for what `trust` allows; the message lists it.
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
    """Go on from an instant of a recording and return the summary of the whole. Call it in the main thread.

        trocar.fork("recordings/table", 4.0, set={"teleop.scale": 0.1}, record="recordings/slower")

    Up to the instant all is simulated again, and every state hash compared; then the devices of the scenario
    lead. The fork's own recording is complete in itself.

    Args:
        recording: A recording, or the path of its directory or MCAP file.
        at: Simulated time, s; it is rounded down to a communication point.
        record: A new directory for the fork's recording.
        set: What changes there, as in `load_scenario`: devices, pace, duration, measures, and parameters of
            engines and controllers that can save their state.
        trust: As in `verify`.
        directory: As in `verify`.
        one_host: Run every participant in this process.
        progress: Is called several times a second of wall time.

    Raises:
        ScenarioError: A change that is not valid, or not possible in a session that runs.
        RecordingError: Not a recording of a session, or one without this instant.
        TrustError: It asks for what `trust` allows; the message lists it.
        SessionError: The session failed, or its past has other state hashes than the recording.
    """
    _warn_of_other_bits()
    opened = recording if isinstance(recording, Recording) else Recording(Path(recording), unfinished=True)
    made = Fork(
        opened,
        round(at * 1e9),
        _overrides(set),
        record=None if record is None else Path(record),
        trust=trust,
        directory=None if directory is None else Path(directory),
        one_host=one_host,
    )
    return made.run(progress)


def _warn_of_other_bits() -> None:
    """Warn where numpy computes with other kernels in this process than in the hosts."""
    if _LATE:
        log.warning(
            "numpy was imported before trocar.run: state hashes may differ from those of the command line. To"
            " have the same, import trocar.sessions first, or start Python with %s",
            " ".join(f"{name}={shlex.quote(value)}" for name, value in _LATE.items()),
        )
