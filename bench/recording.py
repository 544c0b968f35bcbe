"""What recording costs a scenario: off and on in turns, within one session.

    python -m bench.recording palpation teleop --seconds 12 --turn 20

Two runs of a scenario differ by more than recording costs: in the speed of the machine, and in where their
memory lies. Here both are the same, and so are the steps on either side of a turn. What is off is all that a
session without a recorder does not do; its thread rests. The recording has gaps and is thrown away.

Reported is what recording adds to the wall time of a turn: to the sum of all, with the standard error of a
pair's; and how much of a simulated second that is, which at pace `realtime` is its share of the session's.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from hub.hosting.numerics import pin_numerics

pin_numerics(os.environ)  # before numpy: its threads would take the recorder's core

# ruff: noqa: E402
from hub.hosting import outputs
from hub.observation.monitor import Monitor
from hub.planning.scenario_file import load
from hub.session.launch import launch
from hub.session.step_loop import StepLoop
from schemas.lockstep import Grant

ENDPOINT = "tcp/127.0.0.1:0"
WARM_UP = 2
"""Pairs of turns that are not counted: files and memory are new."""

_VECTORS, _PASSAGE = (vars(outputs)[name] for name in ("_Vectors", "_Passage"))
_REPLACED: tuple[tuple[Any, str], ...] = (
    (Monitor, "vectors_listener"),
    (_VECTORS, "__init__"),
    (_PASSAGE, "__init__"),
    (StepLoop, "_step"),
)
"""The functions that tell what records, and where a turn begins."""

Listener = Callable[..., None] | None


class Turn(NamedTuple):
    """What a turn took, s."""

    wall: float
    simulated: float


class Switch:
    """Turns the recording of the next session off and on, in turns of `turn` grants."""

    def __init__(self, turn: int) -> None:
        self.turns: tuple[list[Turn], list[Turn]] = [], []
        """Without and with recording."""
        self._turn, self._grants, self._on, self._begun = turn, 0, True, (0.0, 0)
        self._vectors: list[tuple[Any, Listener, Listener]] = []
        self._passages: list[tuple[Any, list[Any]]] = []
        self._unrecorded: dict[Listener, Listener] = {}
        self._recorder: Any = None
        self._originals: list[Callable[..., Any]] = [getattr(*place) for place in _REPLACED]

    def __enter__(self) -> Switch:
        """Watch what is made from now on."""
        listener, vectors, passage, step = self._originals

        def listening(monitor: Any, *args: Any) -> Listener:
            recorder, monitor._recorder = monitor._recorder, None
            without = listener(monitor, *args)
            monitor._recorder = recorder
            made = listener(monitor, *args)
            self._unrecorded[made] = without
            return made

        def making_vectors(made: Any, *args: Any) -> None:
            vectors(made, *args)
            self._vectors.append((made, made._listener, self._unrecorded.get(made._listener)))

        def making_passage(made: Any, *args: Any) -> None:
            passage(made, *args)
            self._passages.append((made, made._listeners))

        def stepping(loop: Any, grant: Grant) -> None:
            self._next(loop._run)
            step(loop, grant)

        self._replace([listening, making_vectors, making_passage, stepping])
        return self

    def __exit__(self, *_: object) -> None:
        self._replace(self._originals)

    @staticmethod
    def _replace(functions: Sequence[Callable[..., Any]]) -> None:
        for (owner, name), function in zip(_REPLACED, functions, strict=True):
            setattr(owner, name, function)

    def _next(self, run: Any) -> None:
        turn, place = divmod(self._grants, self._turn)
        self._grants += 1
        if place:
            return
        wall, time_ns = self._begun
        if turn:
            self.turns[self._on].append(Turn(perf_counter() - wall, (run.clock.time_ns - time_ns) / 1e9))
        self._put(run, on=turn % 4 in (1, 2))  # off, on, on, off: a trend is in both
        self._begun = perf_counter(), run.clock.time_ns

    def _put(self, run: Any, *, on: bool) -> None:
        monitor = run.monitor
        if self._recorder is None:
            self._recorder = monitor._recorder
        if not on:
            monitor.record()
        self._on = run.recorded = on
        monitor._recorder = self._recorder if on else None
        for vectors, recorded, without in self._vectors:
            vectors._listener = recorded if on else without
        for passage, listeners in self._passages:
            passage._listeners = listeners if on else []


def measure(scenario: str, seconds: float, turn: int) -> str:
    """Run a scenario and return the row of the table."""
    loaded = load(scenario, ["pace=fast", f"duration={seconds} s"])
    with tempfile.TemporaryDirectory() as directory, Switch(turn) as switch:
        launch(loaded, one_host=True, record=Path(directory, "run"), endpoint=ENDPOINT).run()
    pairs = list(zip(*(turns[WARM_UP:] for turns in switch.turns), strict=False))
    if len(pairs) < 2:
        return f"| {scenario} | too few grants: let it run longer, or shorten the turns |"
    error = statistics.stdev(on.wall / off.wall for off, on in pairs) / len(pairs) ** 0.5
    without, simulated = (sum(times) for times in zip(*(off for off, _ in pairs), strict=True))
    added = sum(on.wall for _, on in pairs) - without
    figures = (100 * added / without, 100 * error, 100 * added / simulated, simulated / without)
    return f"| {scenario} | {len(pairs)} | " + " | ".join(f"{figure:.1f}" for figure in figures) + " |"


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scenarios", nargs="+")
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--turn", type=int, default=20, help="grants in a turn")
    parser.add_argument("--runs", type=int, default=1)
    args = parser.parse_args()
    columns = "scenario", "pairs", "of the wall time, %", "+-", "of the simulated, %", "real time, off"
    sys.stdout.write(
        f"load {os.getloadavg()[0]:.1f}\n\n| {' | '.join(columns)} |\n{'|---' * len(columns)}|\n"
    )
    for scenario in args.scenarios:
        for _ in range(args.runs):
            sys.stdout.write(measure(scenario, args.seconds, args.turn) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
