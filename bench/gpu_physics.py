"""Physics of NeedlePick on a GPU by mujoco-warp: speed, and success of the oracle's controls replayed.

    python -m bench.gpu_physics record build/warp --episodes 512     # oracle, model, and the CPU's own replay
    python -m bench.gpu_physics replay build/warp --worlds 4096    # on the GPU's machine: mujoco, mujoco-warp

mujoco-warp has no servos with three inputs (position, velocity, effort). The model for the replay has motors
with the same gains instead, and controls that add up the three. A grasp is friction alone in this scene, so
nothing of a sub-step is left in Python. An env-step is 0.2 s: ten controls, a hundred sub-steps.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

STEPS, CONTROLS, SUB_STEPS = 20, 10, 10
"""Env-steps of an episode, controls of an env-step, and sub-steps of a control."""
FIRST_SEED = 20_000
CONTACTS, ROWS = 24, 160
"""Room for contacts and rows of constraints, for each world."""
RADIUS, NEAR = 11.44e-3, 5e-3
"""Radius of the needle, and distance from the goal that is success, m."""

VARIANTS: dict[str, dict[str, Any]] = {
    "scene": {},
    "impratio 100": {"impratio": 100.0},
    "impratio 10": {"impratio": 10.0},
    "implicitfast": {"integrator": 3},
    "implicitfast, impratio 10": {"integrator": 3, "impratio": 10.0},
    "pyramidal": {"cone": 0, "impratio": 1.0},
}
"""Options of MuJoCo, by the name of the variant: single precision may need others than the scene's."""


def record(directory: Path, episodes: int) -> None:
    """Record the oracle's episodes that succeed: state at the first action, controls, and goal."""
    import mujoco

    import trocar.environments  # noqa: F401
    from engines.mujoco.arms.servos import Servos
    from learning.environments.oracles import oracle
    from learning.environments.registration import make

    env = make("NeedlePick", terminate_on_success=True, hashed=False)
    robot: Any = env._session.participant("robot")
    made: list[np.ndarray] = []
    series = Servos.series

    def noted(self: Servos, *arguments: Any) -> np.ndarray:
        made.append(series(self, *arguments).copy())
        return made[-1]

    Servos.series = noted
    model, kept = plain_model(robot.params), []
    for seed in range(FIRST_SEED, FIRST_SEED + episodes):
        observation, info = env.reset(seed=seed)
        expert, ended = oracle(env), False
        made.clear()
        start = np.concatenate([robot._data.qpos, robot._data.qvel, robot._data.qacc_warmstart])
        for _ in range(STEPS):
            observation, _, ended, _, info = env.step(expert(observation))
            if ended:
                break
        controls = efforts(robot._model, np.concatenate(made))
        still = np.repeat(controls[-1:], STEPS * CONTROLS - len(controls), axis=0)
        kept.append(
            (start, np.concatenate([controls, still]), observation["desired_goal"], info["is_success"])
        )
    starts, controls, goals, success = map(np.array, zip(*kept, strict=True))
    directory.mkdir(parents=True, exist_ok=True)
    mujoco.mj_saveModel(model, str(directory / "needle_pick.mjb"), None)
    np.savez_compressed(
        directory / "controls.npz", starts=starts, controls=controls, goals=goals, success=success
    )
    print(f"{episodes} episodes, oracle in closed loop on the whole model: {success.mean():.4f}")
    for variant in VARIANTS:
        print(
            json.dumps({"variant": variant, "device": "CPU", **replay_on_cpu(directory, variant)}), flush=True
        )


def plain_model(params: Any) -> Any:
    """Return the lean model with a motor in place of each servo: force = control - kp q - kv v."""
    import mujoco

    from engines.mujoco import model
    from engines.mujoco.model import ties
    from engines.mujoco.model.lean import lean

    spec = model.spec(params)
    ties.add(spec, params)
    spec.option.timestep = params.timestep * 1e-9
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_SENSOR)
    spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)  # not known to mujoco-warp
    for actuator in spec.actuators:
        actuator.gaintype, actuator.gainprm = mujoco.mjtGain.mjGAIN_FIXED, [1.0] + [0.0] * 9
        actuator.ctrllimited, actuator.ctrlspec = 0, 0
        actuator.ctrlrange = [0.0, 0.0]
    return lean(spec, params)[0]


def efforts(servos: Any, controls: np.ndarray) -> np.ndarray:
    """Return a motor's control for the three inputs of each servo: kp position + kv velocity + effort."""
    limits = servos.actuator_ctrlrange
    clipped = np.clip(controls, limits[:, 0], limits[:, 1]).reshape(len(controls), -1, 3)
    stiffness, damping = -servos.actuator_biasprm[:, 1], -servos.actuator_biasprm[:, 2]
    return clipped[..., 0] * stiffness + clipped[..., 1] * damping + clipped[..., 2]


def reached(qpos: np.ndarray, goals: np.ndarray, place: int) -> np.ndarray:
    """Return whether the middle of each needle is at its goal: the rule of the environment."""
    position, (w, x, y, z) = qpos[:, place : place + 3], qpos[:, place + 3 : place + 7].T
    axis = np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)], axis=1)
    return np.linalg.norm(position + RADIUS * axis - goals, axis=1) < NEAR


def load(directory: Path, variant: str) -> tuple[Any, dict[str, np.ndarray], int]:
    """Return the model of a variant, the recorded arrays, and the place of the needle in `qpos`."""
    import mujoco

    model = mujoco.MjModel.from_binary_path(str(directory / "needle_pick.mjb"))
    for name, value in VARIANTS[variant].items():
        setattr(model.opt, name, value)
    with np.load(directory / "controls.npz") as arrays:
        return model, dict(arrays), int(model.joint("needle").qposadr[0])


def replay_on_cpu(directory: Path, variant: str) -> dict[str, Any]:
    """Return success and speed of the recorded controls on a thread of the CPU."""
    import mujoco
    from mujoco.batch import Batch

    model, arrays, needle = load(directory, variant)
    starts, controls = arrays["starts"], arrays["controls"]
    success, seconds = np.zeros(len(starts), bool), 0.0
    whole, stride = int(mujoco.mjtState.mjSTATE_INTEGRATION), CONTROLS * SUB_STEPS
    for row, start in enumerate(starts):
        batch, data = Batch(model, nsim=1, nthread=1), mujoco.MjData(model)
        data.qpos, data.qvel, data.qacc_warmstart = np.split(start, [model.nq, model.nq + model.nv])
        mujoco.mj_getState(model, data, batch.state[0], whole)
        control = np.repeat(controls[row], SUB_STEPS, axis=0)
        began = time.perf_counter()
        found = batch.rollout(STEPS * stride, control[None], record=("qpos",))
        seconds += time.perf_counter() - began
        success[row] = reached(found["qpos"][0, stride - 1 :: stride], arrays["goals"][row], needle).any()
    return {"success": float(success.mean()), "env_steps_s": len(starts) * STEPS / seconds}


class Worlds:
    """Many worlds on a GPU, each with the controls of an episode.

    Args:
        directory: the recording.
        variant: of VARIANTS.
        count: number of worlds.
    """

    def __init__(self, directory: Path, variant: str, count: int) -> None:
        import mujoco
        import mujoco_warp
        import warp

        self._warp, self._step = warp, mujoco_warp.step
        model, arrays, self._needle = load(directory, variant)
        rows = np.arange(count) % len(arrays["starts"])
        self._goals = arrays["goals"][rows]
        begun = np.split(arrays["starts"][rows], [model.nq, model.nq + model.nv], axis=1)
        self._begun = [self._on_device(each) for each in begun]
        self._controls = [self._on_device(each) for each in arrays["controls"][rows].swapaxes(0, 1)]
        self._model = mujoco_warp.put_model(model)
        self._data = mujoco_warp.put_data(
            model, mujoco.MjData(model), nworld=count, nconmax=CONTACTS, njmax=ROWS
        )
        self._restart()
        self._step(self._model, self._data)  # compiles
        warp.synchronize()
        self._graph = None
        if warp.get_device().is_cuda:
            with warp.ScopedCapture() as capture:
                self._sub_steps()
            self._graph = capture.graph

    def _on_device(self, values: np.ndarray) -> Any:
        return self._warp.array(np.ascontiguousarray(values, np.float32), dtype=self._warp.float32)

    def _restart(self) -> None:
        data = self._data
        for target, source in zip((data.qpos, data.qvel, data.qacc_warmstart), self._begun, strict=True):
            self._warp.copy(target, source)

    def _sub_steps(self) -> None:
        for _ in range(SUB_STEPS):
            self._step(self._model, self._data)

    def replay(self) -> dict[str, Any]:
        """Return success and speed; the most contacts of all worlds; the most rows of constraints of one."""
        success, seconds, contacts, rows = np.zeros(len(self._goals), bool), 0.0, 0, 0
        qpos = np.zeros(0)
        self._restart()
        for step in range(STEPS):
            self._warp.synchronize()
            began = time.perf_counter()
            for control in self._controls[step * CONTROLS : (step + 1) * CONTROLS]:
                self._warp.copy(self._data.ctrl, control)
                self._sub_steps() if self._graph is None else self._warp.capture_launch(self._graph)
            self._warp.synchronize()
            seconds += time.perf_counter() - began
            qpos = self._data.qpos.numpy()
            success |= reached(qpos, self._goals, self._needle)
            contacts = max(contacts, int(self._data.nacon.numpy()[0]))
            rows = max(rows, int(self._data.nefc.numpy().max()))
        return {
            "success": float(success.mean()),
            "env_steps_s": len(success) * STEPS / seconds,
            "not_finite": int((~np.isfinite(qpos).all(axis=1)).sum()),
            "contacts": contacts,
            "rows": rows,
        }


def replay(directory: Path, variants: list[str], worlds: int, device: str | None) -> None:
    """Replay the episodes in `worlds` worlds at once; print a line of JSON for each variant."""
    import warp

    warp.init()
    with warp.ScopedDevice(device):
        for variant in variants:
            began = time.perf_counter()
            made = Worlds(directory, variant, worlds)
            about = {"variant": variant, "worlds": worlds, "device": warp.get_device().name}
            about["made_s"] = round(time.perf_counter() - began, 1)
            print(json.dumps({**about, "runs": [made.replay() for _ in range(2)]}), flush=True)


def main() -> None:
    """Record, or replay."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=["record", "replay"])
    parser.add_argument("directory", type=Path)
    parser.add_argument("--episodes", type=int, default=512)
    parser.add_argument("--worlds", type=int, default=4096)
    parser.add_argument("--variants", nargs="+", choices=list(VARIANTS), default=list(VARIANTS))
    parser.add_argument("--device")
    asked = parser.parse_args()
    if asked.what == "record":
        record(asked.directory, asked.episodes)
    else:
        replay(asked.directory, asked.variants, asked.worlds, asked.device)


if __name__ == "__main__":
    main()
