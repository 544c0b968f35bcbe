"""The robot as an FMU in FMPy, beside the session with the same commands: joints, and their differences.

python bench/robot_fmu_figure.py docs/pictures/robot-fmu.png

A session with `routine` and `motion` moves a PSM and its jaw, and is recorded. FMPy's `simulate_fmu` runs the
exported FMU with the recorded setpoints. The script prints the largest difference of each joint.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import simulate_fmu
from matplotlib.figure import Figure

from engines.mujoco.export.fmu import write_fmu
from engines.mujoco.params import MujocoParams
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch

MS = 10**6
SCENARIO = """\
name: robot_fmu
step: 1 ms
duration: 6 s
pace: fast
scene: {arms: {PSM1: {instrument: "400006"}}}
participants:
  routine:
    kind: routine
    steps:
      - {do: speed, arm: PSM1, share: 0.5}
      - {do: move_jp, arm: PSM1, positions: [0.3, -0.2, 0.14, 0.8, 0.4, -0.3]}
      - {do: move_jp, arm: PSM1, positions: [-0.3, 0.2, 0.10, -0.8, -0.4, 0.3]}
      - {do: jaw, arm: PSM1, angle: 0.6}
      - {do: move_jp, arm: PSM1, positions: [0, 0, 0.12, 0, 0, 0]}
      - {do: jaw, arm: PSM1, angle: 0}
  motion: {kind: motion, initial_state: homed, publish_period: 10 ms}
  robot: {kind: mujoco}
order: [routine, motion, robot]
connections:
  - routine.* -> motion.*
  - motion.* -> routine.*
  - motion.drive/* -> robot.*
  - robot.* -> motion.sense/*
"""
PARTS = {"PSM1/servo_jp": "PSM1/measured_js", "PSM1/jaw/servo_jp": "PSM1/jaw/measured_js"}


def in_session(folder: Path) -> Recording:
    """Run and record the session."""
    (folder / "scenario.yaml").write_text(SCENARIO)
    launch(load(str(folder / "scenario.yaml")), record=folder / "recording").run()
    return Recording(folder / "recording")


def in_fmpy(recording: Recording, folder: Path) -> Any:
    """Return FMPy's table for the recorded setpoints.

    The robot steps after `motion`: a step takes the setpoint of its end.
    """
    params = MujocoParams.model_validate({"arms": {"PSM1": {"instrument": "400006"}}})
    write_fmu(params, folder / "psm.fmu", "3", MS)
    columns: dict[str, Any] = {}
    for command in PARTS:
        series = recording[f"motion.drive/{command}"]
        for joint, values in zip(series.names, series.values.T, strict=True):
            columns[f"{command.replace('/', '.')}.{joint}"] = values[1:]
    count = len(next(iter(columns.values())))
    rows = np.zeros(count + 1, [("time", "f8"), *((name, "f8") for name in columns)])
    rows["time"] = 1e-3 * np.arange(count + 1)
    for name, values in columns.items():
        rows[name][:-1], rows[name][-1] = values, values[-1]
    return simulate_fmu(str(folder / "psm.fmu"), stop_time=1e-3 * count, output_interval=1e-3, input=rows)


def main() -> None:
    """Run both, print the differences, and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("picture", type=Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recording = in_session(folder)
        table = in_fmpy(recording, folder)
        figure: Any = Figure(figsize=(11, 3.4), layout="constrained")
        angles, insertion, differences = figure.subplots(1, 3)
        for at, port in enumerate(PARTS.values()):
            series = recording[f"robot.{port}"]
            for joint in series.names:
                here = series[f"position.{joint}"]
                there = table[f"{port.replace('/', '.')}.position.{joint}"]
                axis, scale = (insertion, 1e3) if joint == "insertion" else (angles, 1.0)
                (line,) = axis.plot(table["time"], scale * there, linewidth=3, alpha=0.35, label=joint)
                axis.plot(series.time, scale * here, linewidth=0.8, color=line.get_color())
                error = there - here
                differences.plot(table["time"], error, linewidth=0.8, color=f"C{at}")
                print(f"{port} {joint}: {len(here)} samples differ by at most {np.abs(error).max():g}")
        angles.set(xlabel="time, s", ylabel="joints, rad (wide: FMPy, thin: session)")
        insertion.set(xlabel="time, s", ylabel="insertion, mm")
        differences.set(xlabel="time, s", ylabel="FMPy less session, rad and m", ylim=(-1e-15, 1e-15))
        angles.legend(fontsize=7, ncols=2)
        for axis in (angles, insertion, differences):
            axis.grid(alpha=0.3)
        figure.savefig(given.picture, dpi=110)


if __name__ == "__main__":
    main()
