"""What the MuJoCo engine costs beside bare `mj_step` on the same model, and where it goes.

    python bench/mujoco_engine_cost.py --json

Both run in the same process in turns; the median of the rounds' ratios is reported, as single times move with
the machine's load. `ratio` is at one sub-step of 1 ms a step, the worst case; `ratio_10_ms` at ten
sub-steps a step.
"""

from __future__ import annotations

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np

sys.path.remove(str(Path(__file__).parent))  # else this very file is the package `engines`

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import BondPlan, Inputs, Setup
from schemas.codec import decode, encode
from schemas.ports import Port
from schemas.vectors import VectorCodec

SUB_STEP_NS = 1_000_000
ROUNDS = 40
SUB_STEPS_A_ROUND = 500


class Loop:
    """One arm, coupled at the probe, stepped with a period of `sub_steps` ms."""

    def __init__(self, sub_steps: int) -> None:
        self.sub_steps, self.period = sub_steps, sub_steps * SUB_STEP_NS
        params = MujocoParams.model_validate(
            {"arms": {"PSM1": {}}, "timestep": "1 ms", "publish_period": "10 ms"}
        )
        self.engine = MujocoEngine("robot", params)
        self.engine.configure(
            Setup(
                period_ns=self.period, directory=Path(), bonds={"PSM1/probe": BondPlan("velocity", mean=True)}
            )
        )
        self.command, self.wrench = (
            np.array(params.arms["PSM1"].start),
            np.array([0.1, 0.0, 0.5, 0.0, 0.0, 0.0]),
        )
        self.inputs = Inputs({"PSM1/servo_jp": self.command, "PSM1/probe/wrench": self.wrench})
        self.model = self.engine._model
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = self.command
        self.data.ctrl[::2] = self.command

    def run_engine(self) -> None:
        """Take a round's sub-steps in the engine."""
        for _ in range(SUB_STEPS_A_ROUND // self.sub_steps):
            self.engine.step(0, self.period, self.inputs)

    def run_bare(self) -> None:
        """Take a round's sub-steps in bare MuJoCo."""
        for _ in range(SUB_STEPS_A_ROUND):
            mujoco.mj_step(self.model, self.data)

    def compare(self) -> tuple[float, float, float]:
        """Return the ratio, and microseconds per sub-step bare and in the engine, all medians."""
        rounds = [(timed(self.run_bare), timed(self.run_engine)) for _ in range(ROUNDS)]
        per_sub_step = 1e6 / SUB_STEPS_A_ROUND
        bare, engine = (statistics.median(column) * per_sub_step for column in zip(*rounds, strict=True))
        return statistics.median(b / a for a, b in rounds), bare, engine

    def parts(self) -> dict[str, float]:
        """Return microseconds of each thing the engine does in a step beside MuJoCo's own work."""
        arm, motion, model, data = self.engine._arms[0], self.engine._motions[0], self.model, self.data

        def split() -> None:
            mujoco.mj_step2(model, data)
            mujoco.mj_step1(model, data)

        return {
            "clip the command, write position and velocity setpoints": (
                each(lambda: arm.begin(self.inputs))
                - each(lambda: motion.begin(self.inputs, arm._pose, arm._twist))
            ),
            "poses in ROS order, work of the wrench": each(arm.end),
            "mj_step2 + mj_step1 over mj_step (a second call from Python)": (
                each(split) - each(lambda: mujoco.mj_step(model, data))
            ),
            "check of MuJoCo's warnings": each(lambda: any(self.engine._trouble)),
            "not in the ratio: state hash (mj_getState, blake2b)": each(self.engine.state_hash),
        }


def codecs() -> dict[str, float]:
    """Return microseconds to write and to read a pose, as a vector and through the message models."""
    port = Port(name="pose", causality="output", type="geometry_msgs/msg/PoseStamped", frame="world")
    codec, pose = VectorCodec(port), np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0])
    payload = codec.encode(pose, 0)
    return {
        "vector_encode_us": each(lambda: codec.encode(pose, 10**9)),
        "vector_decode_us": each(lambda: codec.decode(payload)),
        "model_encode_us": each(lambda: encode(codec.to_message(pose, 10**9))),
        "model_decode_us": each(lambda: codec.from_message(decode(codec.model, payload))),
    }


def timed(run: Callable[[], None]) -> float:
    """Return the seconds that `run` takes."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def each(call: Callable[[], object], count: int = 1000) -> float:
    """Return the median microseconds of one call."""

    def run() -> None:
        for _ in range(count):
            call()

    return statistics.median(timed(run) for _ in range(9)) / count * 1e6


def measure() -> dict[str, object]:
    """Return all numbers of this benchmark."""
    one, ten = Loop(1), Loop(10)
    ratio, bare_us, engine_us = one.compare()
    ratio_10_ms, _, engine_10_ms_us = ten.compare()
    left = {name: round(value, 3) for name, value in one.parts().items()}
    numbers = {
        "ratio": ratio,
        "bare_us": bare_us,
        "engine_us": engine_us,
        "ratio_10_ms": ratio_10_ms,
        "engine_10_ms_us": engine_10_ms_us,
    }
    return {name: round(value, 3) for name, value in numbers.items()} | {
        "what_is_left": left,
        "codecs": {k: round(v, 3) for k, v in codecs().items()},
    }


def main() -> None:
    """Measure, and print or write the result."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--output", type=Path, help="also write the JSON to this file")
    arguments = parser.parse_args()
    result = measure()
    if arguments.output:
        arguments.output.write_text(json.dumps(result, indent=2) + "\n")
    print(
        json.dumps(result, indent=2)
        if arguments.json
        else "\n".join(f"{name}: {value}" for name, value in result.items())
    )


if __name__ == "__main__":
    main()
