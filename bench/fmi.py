"""Two FMUs in one host beside FMPy's own calls in a loop, and the energy book of the tendon drive.

python bench/fmi.py --json

`loop` calls FMPy's class as its examples do: setReal, doStep and getReal of both FMUs in each step. `session`
is a session of both in one host, with the state hashes of every step. Both exchange the same values, run in
turns, and are measured by processor time of the thread that steps, as others may use the machine. `share`:
steps per second of the session over those of the loop. `same`: the motion is the same in every bit. `book`:
the most that the book of the drive's bond in scenario `tendon` was wrong, over the work that went through the
bond in 10 s.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract
from fmpy.fmi2 import FMU2Slave

from engines.fmu.engine import FmuParams
from hub.planning.plan import PlannedParticipant
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch, plan_of
from hub.session.session import Session
from schemas.lockstep import Ack
from schemas.scenario import Scenario

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.engines.fmus import build

SPRING, GUID = "mass_spring_damper", "{trocar-mass-spring-damper}"
STEP_S, STEP_NS = 1e-3, 1_000_000
STEPS = 4000
ROUNDS = 7
STARTS = ({"x": 0.1}, {"x": 0.0, "c": 40.0})
REFERENCES = {"F": 0, "x": 1, "c": 5}


def compiled(folder: Path) -> Path:
    """Return the test FMU, a mass on a spring, with a force that takes a position."""
    no_unit = {'<Real unit="N" start="0"/>': '<Real unit="m" start="0"/>'}
    return build.pack(SPRING, build.compile_library(SPRING, folder), folder / "mass.fmu", no_unit)


def loop(path: Path) -> tuple[float, float]:
    """Return microseconds a step of FMPy in a loop, and the last position of the first mass."""
    masses: list[Any] = []
    for starts in STARTS:
        mass = FMU2Slave(
            guid=GUID, modelIdentifier=SPRING, unzipDirectory=extract(str(path)), instanceName="mass"
        )
        mass.instantiate()
        mass.setupExperiment(startTime=0.0)
        for name, value in starts.items():
            mass.setReal([REFERENCES[name]], [value])
        mass.enterInitializationMode()
        mass.exitInitializationMode()
        masses.append(mass)
    one, two = masses
    force, position = [REFERENCES["F"]], [REFERENCES["x"]]
    of_one, of_two = one.getReal(position), two.getReal(position)
    begun = time.thread_time()
    for i in range(STEPS):
        one.setReal(force, of_two)
        two.setReal(force, of_one)
        t, end = i * STEP_NS / 1e9, (i + 1) * STEP_NS / 1e9
        one.doStep(currentCommunicationPoint=t, communicationStepSize=end - t)
        two.doStep(currentCommunicationPoint=t, communicationStepSize=end - t)
        of_one, of_two = one.getReal(position), two.getReal(position)
    taken = (time.thread_time() - begun) / STEPS * 1e6
    for mass in masses:
        mass.terminate()
        mass.freeInstance()
    return taken, of_one[0]


def session(path: Path, window: int) -> tuple[float, float]:
    """Return microseconds a step of a session in its second half, and the last position of the first mass."""
    scenario = Scenario.model_validate(
        {
            "name": "two_fmus",
            "step": STEP_S,
            "duration": STEPS * STEP_S,
            "window": window,
            "algorithm": "jacobi",
            "participants": {"one": {"kind": "fmu"}, "two": {"kind": "fmu"}},
            "connections": ["one.x -> two.F", "two.x -> one.F"],
            "measure": {"x": {"kind": "final", "of": "one.x"}},
        }
    )
    params = {
        name: FmuParams(path=path, start=start) for name, start in zip(("one", "two"), STARTS, strict=True)
    }
    plan, participants = plan_of(scenario, params)
    reported: list[tuple[int, float]] = []

    def on_ack(_member: PlannedParticipant, ack: Ack) -> None:
        reported.append((ack.step, time.thread_time()))

    made = Session(scenario, plan, participants, path.parent, endpoint="tcp/127.0.0.1:0", on_ack=on_ack)
    summary = made.run()
    (first, begun), (last, ended) = reported[len(reported) // 2], reported[-1]
    return (ended - begun) / (last - first) * 1e6, summary.measures["x"]


def speeds(window: int) -> dict[str, float]:
    """Return microseconds a step of both, their share, and whether the motion is the same."""
    with tempfile.TemporaryDirectory() as folder:
        path = compiled(Path(folder))
        rounds = [(loop(path), session(path, window)) for _ in range(ROUNDS)]
    fmpy_us, trocar_us = (statistics.median(one[k][0] for one in rounds) for k in (0, 1))
    return {
        "loop_us": fmpy_us,
        "session_us": trocar_us,
        "share": statistics.median(one[0][0] / one[1][0] for one in rounds),
        "same": float(all(one[0][1] == one[1][1] for one in rounds)),
    }


def book() -> dict[str, float]:
    """Return the work (J) through the drive's bond, the largest residual of its book, and the share."""
    with tempfile.TemporaryDirectory() as folder:
        summary = launch(load("tendon", []), record=Path(folder) / "tendon").run()
        books = Recording(Path(folder) / "tendon").energy("robot/PSM1/insertion")
        rows = [(entry.motion_work_j, entry.residual_j) for _, entry in books]
    work, residual = np.array(rows).T
    exchanged = float(np.abs(np.diff(work)).sum())
    worst = float(np.abs(residual).max())
    return {
        "exchanged_j": exchanged,
        "residual_j": worst,
        "book": worst / exchanged,
        "lost_j": summary.measures["lost_j"],
    }


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--window", type=int, default=48, help="steps in one grant")
    parser.add_argument("--no-book", action="store_true", help="speeds alone")
    given = parser.parse_args()
    figures = speeds(given.window) | ({} if given.no_book else book())
    if given.json:
        print(json.dumps(figures, indent=2))
    else:
        print("\n".join(f"{name:25} {value:.4g}" for name, value in figures.items()))


if __name__ == "__main__":
    main()
