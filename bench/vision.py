"""Visual servoing and needle tracking, over random goals and needles.

    python -m bench.vision [servoing] [out-of-reach] [servoing-pictures] [tracking] [trouble]
                           [tracking-pictures] [carried-pictures] [--seeds 50] [--json]

`servoing` and `out-of-reach` use the law with an ideal camera at 25 Hz, `tracking` and `trouble` the filter
with what the camera model says that the eyes see (`bench.vision_goals`, `bench.vision_needle`); `-pictures`
use the renderer: the controller with an ideal arm, the scenario `needle-tracking`, and many needles in an
arm that is put where it is (`bench.vision_pictures`). All times are simulated. Errors are medians, with the
90th percentile behind them, over all pictures after the first second.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares

import trocar
from bench.vision_goals import CAMERA, CHAIN, features, random_goal, servo
from bench.vision_needle import AUTHORS, OURS, Trouble, track
from bench.vision_pictures import PICTURED, track_pictures
from controllers.visual_servoing.controller import VisualServoing
from controllers.visual_servoing.params import ServoingParams
from hub.participant import Inputs, Setup
from robots.transform import matrix_to_pose

Row = dict[str, float | str]
_SECOND = 25
"""Pictures in a second."""
_H = 40_000_000


def spread(values: object) -> str:
    flat = np.asarray(values, float).ravel()
    return f"{np.median(flat):.3g} ({np.percentile(flat, 90):.3g})"


def servoing(seeds: int) -> Iterator[Row]:
    for law in ("direct", "twist"):
        for gain, noise in ((2.0, 0.0), (2.0, 0.2), (0.5, 0.0)):
            rng = np.random.default_rng(1)
            runs = [
                servo(law, gain, *random_goal(rng), seconds=8.0 / gain + 4.0, noise_px=noise, rng=rng)
                for _ in range(seeds)
            ]
            times = np.array([run.time for run in runs])
            yield {
                "law": law,
                "gain 1/s": gain,
                "noise px": noise,
                "below 1 px": f"{np.isfinite(times).sum()} of {seeds}",
                "time s": spread(times[np.isfinite(times)]),
                "outside px": round(float(max(run.outside for run in runs)), 3),
            }


def out_of_reach(seeds: int) -> Iterator[Row]:
    """Goals of which each feature is off by 3 % of the depth: how far from the least squares it rests."""
    for law in ("direct", "twist"):
        rng, shares = np.random.default_rng(2), list[float]()
        for _ in range(seeds):
            reached, start, target = random_goal(rng)
            goal = features(CHAIN.forward(reached), target) + 0.03 * rng.normal(size=(4, 2))

            def residuals(q: np.ndarray, target: np.ndarray = target, goal: np.ndarray = goal) -> np.ndarray:
                return (features(CHAIN.forward(q), target) - goal).ravel()

            best = least_squares(residuals, reached, bounds=(CHAIN.lower, CHAIN.upper), xtol=1e-12)
            rest = servo(law, 2.0, reached, start, target, goal=goal, seconds=15.0).rest
            shares.append(100.0 * (rest / np.sqrt(2.0 * best.cost) - 1.0))
        yield {
            "law": law,
            "above the least, %": spread(np.round(shares, 6)),
            "worst, %": round(float(max(shares)), 3),
            "within 1 %": f"{sum(share < 1.0 for share in shares)} of {seeds}",
        }


def servoing_pictures(seeds: int, looks: str) -> Iterator[Row]:
    """The controller with rendered pictures and an arm that is where it is commanded to be."""
    rng = np.random.default_rng(3)
    for number in range(seeds):
        reached, start, target = random_goal(rng)
        lost = range(20, 20 + _SECOND) if number % 2 else range(0)
        errors = _steered(reached, start, target, lost, looks)
        above = np.flatnonzero(errors >= 1.0)
        yield {
            "goal": number,
            "blobs lost": "for 1 s" if lost else "no",
            "time s": round((int(above[-1]) + 1) * 0.04, 2),
            "at the end px": round(float(errors[-1]), 3),
        }


def _steered(
    reached: np.ndarray, start: np.ndarray, target: np.ndarray, lost: range, looks: str
) -> np.ndarray:
    """Return the distances (px) of the features from the goal at each picture."""
    from engines.mujoco.model import build
    from engines.mujoco.pictures.endoscope import Endoscope
    from engines.mujoco.pictures.endoscope_params import EndoscopeParams

    box = matrix_to_pose(target @ np.diag([1.0, -1.0, -1.0, 1.0])).tolist()  # its z axis points to the camera
    scene = {
        "arms": {"ECM": {"start": start.tolist()}},
        "fixtures": {"box": {"kind": "disc-box", "position": box[:3], "orientation": box[3:]}},
        "looks": "none" if looks == "plain" else looks,
        "width": CAMERA.width,
        "height": CAMERA.height,
    }
    goal = features(CHAIN.forward(reached), target)
    controller = VisualServoing(
        "servoing", ServoingParams.model_validate({"goal": goal.tolist(), "start": start.tolist()})
    )
    controller.configure(Setup(_H, Path()))
    errors, q, events = list[float](), start, dict[str, tuple[Any, ...]]()
    given = EndoscopeParams.model_validate(scene)
    model = build(given)
    qpos = model.qpos0.copy()
    joints = [model.joint(f"ECM/{joint.name}").qposadr[0] for joint in CHAIN.joints]
    with Endoscope("endoscope", given) as endoscope:
        endoscope.configure(Setup(_H, Path()))
        for i in range(5 * _SECOND):
            values = {"measured_js": np.concatenate([q, np.zeros(8)])}
            outputs = controller.step(i * _H, _H, Inputs(values, events=events))
            qpos[joints] = q
            pictures = endoscope.step(i * _H, _H, Inputs({"qpos": qpos}))
            events = {} if i in lost else {name: tuple(pictures[name]) for name in _EYE}
            seen = features(CHAIN.forward(q), target)
            errors.append(float(np.hypot(*(seen - goal).T).max()) * CAMERA.focal_length)
            q = outputs["servo_jp"][:4].copy()
    return np.array(errors)


_EYE = ("left/image_raw", "left/camera_info")


def tracking(seeds: int) -> Iterator[Row]:
    for name, camera, eyes in (
        ("ours, both eyes", OURS, 2),
        ("ours, one eye", OURS, 1),
        ("authors', both eyes", AUTHORS, 2),
        ("authors', one eye", AUTHORS, 1),
    ):
        runs = [track(camera, eyes, seed) for seed in range(seeds)]
        nees = np.array([run.nees[_SECOND::12] for run in runs])
        band = 2.0 * np.sqrt(12.0 / nees.size)
        yield {
            "camera": name,
            "position mm": spread([run.position[_SECOND:] for run in runs]),
            "normal deg": spread([run.normal[_SECOND:] for run in runs]),
            "axis deg": spread([run.axis[_SECOND:] for run in runs]),
            "worst mm": round(float(max(run.position[_SECOND:].max() for run in runs)), 2),
            "NEES": f"{nees.mean():.2f} (6 +- {band:.2f})",
        }


def trouble(seeds: int) -> Iterator[Row]:
    """How many needles are found again: within 1.5 mm, 3 degrees (normal), 4 degrees (axis) from 1 s on."""
    at = 40
    for name, what in {
        "slip of 20 degrees": Trouble(slip=at),
        "tip covered for 2 s": Trouble(covered=range(at, at + 2 * _SECOND)),
        "another green arc": Trouble(other=True),
        "slip beside another arc": Trouble(slip=at, other=True),
        "slip, tip covered": Trouble(slip=at, covered=range(at + 5, at + 5 + 2 * _SECOND)),
    }.items():
        for camera, runs in (
            ("ours", [track(OURS, 2, seed, trouble=what) for seed in range(seeds)]),
            ("authors'", [track(AUTHORS, 2, seed, trouble=what) for seed in range(seeds)]),
        ):
            after = slice(at + _SECOND, at + 2 * _SECOND)
            kept = [
                run.position[after].max() < 1.5
                and run.normal[after].max() < 3.0
                and run.axis[after].max() < 4.0
                for run in runs
            ]
            off = [(run.position[at:] > 1.5) | (run.normal[at:] > 3.0) for run in runs]
            back = [(int(np.flatnonzero(each).max(initial=-1)) + 1) / _SECOND for each in off]
            yield {
                "trouble": name,
                "camera": camera,
                "good from 1 s on": f"{sum(kept)} of {seeds}",
                "found again after s": spread(back),
                "position mm": spread([run.position[after] for run in runs]),
            }


def tracking_pictures(seeds: int, looks: str) -> Iterator[Row]:  # noqa: ARG001
    """The scenario as it is, and with the authors' camera."""
    for name, values in PICTURED.items():
        with tempfile.TemporaryDirectory() as directory:
            record = Path(directory) / "session"
            values = values | {"participants.endoscope.looks": looks}
            trocar.run("needle-tracking", set=values, pace="fast", one_host=True, record=record)
            recording = trocar.Recording(record)
            found = {
                port: recording[f"check.{port}"].values[_SECOND:, 0]
                for port in ("position_error", "normal_error", "axis_error", "marks_error", "nees")
            }
            yield {
                "camera": name,
                "position mm": spread(1e3 * found["position_error"]),
                "normal deg": spread(np.degrees(found["normal_error"])),
                "axis deg": spread(np.degrees(found["axis_error"])),
                "E (SRC) mm": spread(1e3 * found["marks_error"]),
                "NEES": spread(found["nees"]),
                "slips": float(recording["tracker.slips"].values[-1, 0]),
            }


def carried_pictures(seeds: int, looks: str) -> Iterator[Row]:
    """Rendered pictures of as many needles, held and carried otherwise, without physics."""
    for name, changes in PICTURED.items():
        changes = changes | {"participants.endoscope.looks": looks}
        runs = [track_pictures(changes, seed) for seed in range(seeds)]
        found = {port: np.array([run[port][_SECOND:] for run in runs]) for port in runs[0]}
        yield {
            "camera": name,
            "position mm": spread(1e3 * found["position"]),
            "normal deg": spread(np.degrees(found["normal"])),
            "axis deg": spread(np.degrees(found["axis"])),
            "E (SRC) mm": spread(1e3 * found["marks"]),
            "NEES": f"mean {found['nees'].mean():.2f}, {spread(found['nees'])}",
        }


PARTS: dict[str, Callable[[int], Iterator[Row]]] = {
    "servoing": servoing,
    "out-of-reach": out_of_reach,
    "tracking": tracking,
    "trouble": trouble,
}
PICTURED_PARTS: dict[str, Callable[[int, str], Iterator[Row]]] = {
    "servoing-pictures": servoing_pictures,
    "tracking-pictures": tracking_pictures,
    "carried-pictures": carried_pictures,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, *PICTURED_PARTS, []], help="default: all")
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--looks", choices=["plain", "endoscope"], default="plain", help="of drawn pictures")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    for part in given.parts or [*PARTS, *PICTURED_PARTS]:
        if not given.json:
            print(f"\n{part}, {given.seeds} seeds")
        drawn = PICTURED_PARTS.get(part)
        for row in PARTS[part](given.seeds) if drawn is None else drawn(given.seeds, given.looks):
            print(json.dumps({"part": part} | row) if given.json else row, flush=True)


if __name__ == "__main__":
    main()
