"""Cost of a session beside its bare participants: every scenario of `configs`.

    python -m bench.live                                  # all scenarios, from begin to end, 20 s at most
    python -m bench.live table palpation --seconds 1
    python -m bench.live --output live.json --docs        # and redraw the table in docs/live.md

*Bare* is the same participants in one process, with the inputs that a session gave them: `step` in a loop, no
hub, no wire, no hashes, no devices. Session and bare run in turns, in the same program; the medians are
reported. Wall time and processor time are those between the first and the last step: starting is left out.
Before it is timed, a bare run must reach the session's state hashes: it is the same work.

The first seconds of a scenario tell little: in those of `palpation` nothing is touched, and tissue that is
pressed costs twice as much. So scenarios run to their ends, or for `LONGEST_S`.

At pace `fast` cameras are in lock-step. Where they are observers in real time, the session runs at that pace
too: simulated time over wall time without the waits for the wall clock is *attainable*.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, NamedTuple

import numpy as np

from bench.live_table import redraw, table
from bench.ros_figures import cpu_s
from hub.observation.summary import Progress
from hub.participant import Inputs, Outputs, Setup, Stepped
from hub.planning.plan import PlannedParticipant
from hub.planning.scenario_file import installed_scenarios, load
from hub.session.launch import in_one_host, launch, plan_of
from hub.session.session import Session
from hub.transport.router_client import RouterClient
from schemas.lockstep import Ack

LEFT_OUT = {
    "browser": "a person drives it from a page",
    "cholecystectomy-by-hand": "a person drives it from a page",
    "clip-and-cut-by-hand": "a person drives it from a page",
    "clip-and-cut-by-policy": "a policy's server drives it",
    "keys": "a person drives it by the keyboard",
    "peg-board-keys": "a person drives it by the keyboard",
    "ros-policy": "a policy's server drives a real arm",
}
"""Scenarios that do not run by themselves."""

LONGEST_S = 20.0
"""Simulated time of a run where a scenario is longer, or has no end."""

ENDPOINT = "tcp/127.0.0.1:0"
WALL_CLOCK = "waiting for the wall clock"
"""The phase of a profile in which a session waits for nothing else."""


class Case(NamedTuple):
    """A row of the table: a scenario, and how it runs."""

    name: str
    scenario: str
    apart: bool = False
    """Whether its tissue has a process of its own."""
    recorded: bool = False

    @property
    def settings(self) -> list[str]:
        """What is set in the scenario."""
        return ["participants.tissue.host=tissue"] if self.apart else []


@dataclass
class Cost:
    """Of one run, from its first step to its last, in seconds."""

    sim_s: float
    wall_s: float
    core_s: float


class Call(NamedTuple):
    """One step of one participant, as a session asked for it."""

    name: str
    t: int
    h: int
    inputs: Inputs


class Capture:
    """What a session asked of its participants, and the state hashes that they reached."""

    def __init__(self) -> None:
        self.setups: dict[str, Setup] = {}
        self.calls: list[Call] = []
        self.hashes: dict[str, list[int]] = {}

    def watch(self, name: str, participant: Stepped) -> None:
        """Note what this participant is configured with and stepped with."""
        configure, step = participant.configure, participant.step

        def noting_configure(setup: Setup) -> Outputs:
            self.setups[name] = setup
            return configure(setup)

        def noting_step(t: int, h: int, inputs: Inputs) -> Outputs:
            self.calls.append(Call(name, t, h, copied(inputs)))
            return step(t, h, inputs)

        setattr(participant, "configure", noting_configure)  # noqa: B010
        setattr(participant, "step", noting_step)  # noqa: B010

    @property
    def end_s(self) -> float:
        """When the last step ended: a scenario may end before its duration."""
        return max(call.t + call.h for call in self.calls) / 1e9

    def take(self, planned: PlannedParticipant, ack: Ack) -> None:
        """Note the state hashes of an ack."""
        self.hashes.setdefault(planned.name, []).extend(ack.state_hash)


def copied(inputs: Inputs) -> Inputs:
    """Return inputs that nobody writes to."""

    def copies(values: Mapping[str, Any]) -> dict[str, Any]:
        return {name: v.copy() if isinstance(v, np.ndarray) else v for name, v in values.items()}

    return Inputs(
        copies(inputs._values),
        rates=copies(inputs._rates),
        events=dict(inputs._events),
        stale=set(inputs._stale),
    )


def overrides(seconds: float, pace: str = "fast") -> list[str]:
    """Return the overrides of all runs at a pace."""
    return [f"pace={pace}", f"duration={seconds} s"]


def capture(scenario: str, seconds: float) -> Capture:
    """Run a scenario in one process, and note what its participants are asked."""
    found, file = Capture(), load(scenario, overrides(seconds))
    scenario_here = in_one_host(file.scenario)
    plan, participants = plan_of(scenario_here, file.params)
    for name, participant in participants.items():
        if isinstance(participant, Stepped):
            found.watch(name, participant)
    foreign = [p.foreign_keys for p in participants.values() if isinstance(p, RouterClient)]
    Session(
        scenario_here,
        plan,
        participants,
        file.source.directory,
        endpoint=ENDPOINT,
        foreign_keys=[key for keys in foreign for key in keys],
        on_ack=found.take,
    ).run()
    return found


def run_bare(scenario: str, seconds: float, captured: Capture, *, check: bool = False) -> Cost:
    """Step the participants of a scenario with captured inputs, and nothing around them.

    `check` compares the state hashes instead of being quick; raises ValueError at the first difference.
    """
    file = load(scenario, overrides(seconds))
    _, participants = plan_of(file.scenario, file.params)
    made = {name: participants[name] for name in captured.setups}
    stepped = {name: p for name, p in made.items() if isinstance(p, Stepped)}
    for name, participant in stepped.items():
        participant.configure(captured.setups[name])
    try:
        if check:
            _check(stepped, captured)
        calls = [] if check else [(stepped[call.name].step, *call[1:]) for call in captured.calls]
        cpu, begun = process_time(), perf_counter()
        for step, t, h, inputs in calls:
            step(t, h, inputs)
        return Cost(captured.end_s, perf_counter() - begun, process_time() - cpu)
    finally:
        for participant in stepped.values():
            participant.close()


def _check(stepped: Mapping[str, Stepped], captured: Capture) -> None:
    left = {name: iter(hashes) for name, hashes in captured.hashes.items()}
    for call in captured.calls:
        participant = stepped[call.name]
        participant.step(call.t, call.h, call.inputs)
        if participant.state_hash() != next(left[call.name]):
            raise ValueError(f"'{call.name}' reached another state than in the session at {call.t} ns")


class Meter:
    """Measures a session between the first and the last call of its progress."""

    def __init__(self) -> None:
        self._marks: list[tuple[float, float, float]] = []

    def __call__(self, progress: Progress) -> None:
        """Note how far the session is, and the times of this process and its children."""
        self._marks.append((progress.sim_time_s, perf_counter(), _tree_s()))

    @property
    def cost(self) -> Cost:
        """What the session took."""
        first, last = self._marks[0], self._marks[-1]
        return Cost(*(after - before for before, after in zip(first, last, strict=True)))


def _tree_s() -> float:
    """Return the processor time of this process, of its children that run, and of those that have ended."""
    children: set[str] = set()
    for task in Path("/proc/self/task").iterdir():
        with suppress(FileNotFoundError):  # the thread has just ended
            children.update((task / "children").read_text().split())
    ended = os.times()
    running = 0.0
    for child in children:
        with suppress(FileNotFoundError):  # has just ended, and is not yet among the ended ones
            running += cpu_s(int(child))
    return process_time() + ended.children_user + ended.children_system + running


def run_session(case: Case, seconds: float) -> Cost:
    """Run a scenario as `trocar run` does."""
    with tempfile.TemporaryDirectory() as directory:
        meter = Meter()
        launch(
            load(case.scenario, overrides(seconds) + case.settings),
            endpoint=ENDPOINT,
            record=Path(directory) / "run" if case.recorded else None,
        ).run(meter)
        return meter.cost


def run_attainable(case: Case, seconds: float) -> float | None:
    """Return the real-time factor that a session with observers could reach at pace `realtime`.

    Its profile tells the waits for the wall clock from all else. None: it has no observers.
    """
    file = load(case.scenario, overrides(seconds, "realtime") + case.settings)
    session = launch(file, endpoint=ENDPOINT, profile=True)
    if not session.plan.observers():
        return None
    profile = session.run().profile
    assert profile is not None
    phases = profile["step"]["hub"]
    step_s = sum(row["wall_s"] for name, row in phases.items() if name != WALL_CLOCK)
    return session.plan.step_ns / 1e9 / step_s


def simulated_s(scenario: str, seconds: float | None) -> float:
    """Return how long a scenario is run, in simulated seconds: `seconds`, or as long as it lasts."""
    duration = load(scenario).scenario.duration
    whole = LONGEST_S if duration is None else min(duration / 1e9, LONGEST_S)
    return whole if seconds is None else min(seconds, whole)


def cases(scenarios: Sequence[str]) -> list[Case]:
    """Return the rows of these scenarios, by default of all."""
    names = scenarios or [name for name in sorted(installed_scenarios()) if name not in LEFT_OUT]
    rows = [Case(name, name) for name in names if name != "palpation"]
    if "palpation" in names:
        rows += [
            Case(f"palpation, {places} {kept}", "palpation", apart, recorded)
            for places, apart in (("one process,", False), ("two processes,", True))
            for kept, recorded in (("not recorded", False), ("recorded", True))
        ]
    return rows


def measure(case: Case, captured: Capture, seconds: float, runs: int) -> dict[str, Any]:
    """Return the row of a case: medians of `runs` runs of session and bare, in turns."""
    pairs = [(run_session(case, seconds), run_bare(case.scenario, seconds, captured)) for _ in range(runs)]
    attainable = [factor for _ in range(runs) if (factor := run_attainable(case, seconds)) is not None]

    def median(values: Iterable[float]) -> float:
        return round(statistics.median(values), 4)

    return {
        "name": case.name,
        "seconds": round(captured.end_s, 3),
        "real_time_factor": median(ours.sim_s / ours.wall_s for ours, _ in pairs),
        "attainable_real_time_factor": median(attainable) if attainable else None,
        "bare_real_time_factor": median(bare.sim_s / bare.wall_s for _, bare in pairs),
        "wall_ratio": median(ours.wall_s / ours.sim_s * bare.sim_s / bare.wall_s for ours, bare in pairs),
        "core_ratio": median(ours.core_s / ours.sim_s * bare.sim_s / bare.core_s for ours, bare in pairs),
        "core_s_per_sim_s": median(ours.core_s / ours.sim_s for ours, _ in pairs),
        "bare_core_s_per_sim_s": median(bare.core_s / bare.sim_s for _, bare in pairs),
        "runs": [[asdict(ours), asdict(bare)] for ours, bare in pairs],
    }


def measured(scenarios: Sequence[str], seconds: float | None, runs: int) -> dict[str, Any]:
    """Measure scenarios, and return all figures."""
    result: dict[str, Any] = {
        "whole": not scenarios,
        "runs": runs,
        "cores": len(os.sched_getaffinity(0)),
        "load_begin": os.getloadavg(),
        "left_out": LEFT_OUT,
        "rows": [],
    }
    captured: tuple[str, Capture] | None = None
    for case in cases(scenarios):
        time_s = simulated_s(case.scenario, seconds)
        if captured is None or captured[0] != case.scenario:
            captured = case.scenario, capture(case.scenario, time_s)
            run_bare(case.scenario, time_s, captured[1], check=True)
        row = measure(case, captured[1], time_s, runs)
        result["rows"].append(row)
        print({name: value for name, value in row.items() if name != "runs"}, file=sys.stderr)
    return result | {"load_end": os.getloadavg()}


def main() -> None:
    """Measure, print the table, and write what was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "scenarios", nargs="*", metavar="SCENARIO", help="default: all that run by themselves"
    )
    parser.add_argument("--seconds", type=float, help="simulated time of a run, at most")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--output", type=Path, metavar="FILE", help="write all figures as JSON")
    parser.add_argument("--input", type=Path, metavar="FILE", help="measure nothing; read such figures")
    parser.add_argument(
        "--docs", action="store_true", help="redraw the table of docs/live.md, or the rows of SCENARIO in it"
    )
    options = parser.parse_args()
    if options.input:
        result = json.loads(options.input.read_text(encoding="utf-8"))
    else:
        result = measured(options.scenarios, options.seconds, options.runs)
    if options.output:
        options.output.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    if options.docs:
        redraw(result)
    print(table(result))


if __name__ == "__main__":
    main()
