"""Stitches without a hub and pictures: force over depth, energy, accuracy, and success over seeds.

Lead, motion controller, engine, pad and task of the scenario `suturing` are stepped in one process, in the
order of its plan. `guided` does so with `suturing-by-hand`, and picks stitches of any direction, as `plans`
does without physics. `force` turns a needle through the pad alone, by hand. Results:
docs/decisions/0062-needle-in-tissue.md, 0063-stitches.md and 0102-hands-exchange-their-parts.md.

    python -m bench.suturing stitches --seeds 10 --set participants.lead.stitches=1
    python -m bench.suturing success --rows one.jsonl --seeds 40
    python -m bench.suturing success --rows one-off.jsonl --seeds 40 --errors
    python -m bench.suturing success --rows four.jsonl --seeds 20 --stitches 4
    python -m bench.suturing guided --rows guided.jsonl --seeds 50
    python -m bench.suturing plans --stitches 1000
    python -m bench.suturing force --picture force.png
"""

from __future__ import annotations

import argparse
import json
import re
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from math import asin, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from controllers.stitching.geometry import stitch_between
from controllers.stitching.stage import Stage
from controllers.stitching.way_on import way_on
from engines.suture_pad.channel import Channel
from engines.suture_pad.tissue import TissueParams
from hub.participant import Inputs, Setup
from hub.planning import registry
from hub.planning.scenario_file import load
from hub.planning.wiring import make_plan
from hub.session.launch import in_one_host
from robots.training.needles import NEEDLES
from robots.transform import matrix_to_pose, pose_to_matrix
from schemas.errors import MotionError
from schemas.ros import Header, Point, PointStamped, StringMessage
from schemas.vectors import Vector

LEFT_OUT = ("endoscope", "hands", "left_hand", "right_hand", "markers", "ros")


def _make(kind: str, name: str, params: Any) -> Any:
    return registry.load(kind)(name, params)


class Trial:
    """The participants of a scenario, stepped one after the other in this process."""

    def __init__(self, name: str, overrides: Sequence[str]) -> None:
        file = load(name, overrides)
        kept = {n: spec for n, spec in file.scenario.participants.items() if n not in LEFT_OUT}
        scenario = in_one_host(
            file.scenario.model_copy(
                update={
                    "participants": kept,
                    "order": tuple(n for n in file.scenario.order or () if n in kept) or None,
                    "connections": [
                        c
                        for c in file.scenario.connections
                        if {c.source.participant, c.target.participant} <= kept.keys()
                    ],
                }
            )
        )
        self.parts = {n: _make(spec.kind, n, file.params[n]) for n, spec in kept.items()}
        self.plan = make_plan(scenario, self.parts, dict.fromkeys(kept, "engine"))
        self.limit_ns = scenario.duration or 0
        self.out: dict[str, dict[str, Any]] = {}
        self.time_ns = 0
        self._wire()

    def _wire(self) -> None:
        plan, step = self.plan, self.plan.step_ns
        self._events = {
            (n, port.name)
            for n, part in self.parts.items()
            for port in part.ports
            if port.variability == "event"
        }
        self._ways = [(c.source, c.source_port, c.target, c.target_port) for c in plan.connections]
        for planned in plan.bonds:
            motion, force = planned.bond.motion, planned.bond.force
            for what in ("position", "velocity"):
                there = (force.participant, f"{force.port}/{what}")
                self._ways.append((motion.participant, f"{motion.port}/{what}", *there))
            there = (motion.participant, f"{motion.port}/force")
            self._ways.append((force.participant, f"{force.port}/force", *there))
        self._values: dict[str, dict[str, Any]] = {n: {} for n in self.parts}
        self._waiting: dict[str, dict[str, list[Any]]] = {n: {} for n in self.parts}
        for n, part in self.parts.items():
            period = plan.participants[n].period * step
            connected = frozenset(c.target_port for c in plan.connections if c.target == n)
            setup = Setup(period, Path(), plan.participants[n].bond_plans, connected)
            self.out[n] = dict(part.configure(setup))
            for port in part.ports:
                if port.causality == "input" and port.start is not None and port.variability == "signal":
                    self._values[n][port.name] = np.array(port.start)

    def step(self) -> None:
        for n in self.plan.order:
            period = self.plan.participants[n].period * self.plan.step_ns
            if self.time_ns % period:
                continue
            values, waiting = self._values[n], self._waiting[n]
            self._waiting[n] = {}
            for source, port, target, into in self._ways:
                if target == n and (n, into) not in self._events and port in self.out[source]:
                    values[into] = self.out[source][port]
            events = {into: tuple(messages) for into, messages in waiting.items()}
            outputs = self.parts[n].step(self.time_ns, period, Inputs(values, events=events))
            self.out[n].update(outputs)
            for source, port, target, into in self._ways:
                if source == n and (target, into) in self._events and outputs.get(port):
                    self._waiting[target].setdefault(into, []).extend(outputs[port])
        self.time_ns += self.plan.step_ns

    def send(self, participant: str, port: str, message: Any) -> None:
        """Let an event come to a participant in its next step."""
        self._waiting[participant].setdefault(port, []).append(message)

    def run(self) -> dict[str, Any]:
        """Step until the lead ends, and return the row of the table."""
        began = time.process_time()
        said: list[str] = []
        while self.time_ns < self.limit_ns and not self.parts["lead"].ended:
            self.step()
            if not self.time_ns % 10_000_000:
                said += [message.data for message in self.out["lead"]["status"]]
        card = self.parts["task"].card(self.time_ns)
        values = {value.name: value for value in card.metrics}
        rules = {rule.rules: {value.name: value for value in rule.values} for rule in card.rules}
        needle, pad = self.out["robot"], self.out["pad"]
        bond = self.plan.bonds[0].bond
        motion_j = float(needle[f"{bond.motion.port}/work"][0])
        force_j = float(pad[f"{bond.force.port}/work"][0])
        names = ("entry_error_mean", "exit_error_mean", "depth", "force", "trauma", "made")
        return {
            "simulated_s": self.time_ns * 1e-9,
            "cpu_s": time.process_time() - began,
            **{n: _number(values[f"stitches/{n}"]) for n in names},
            "exchanged_j": motion_j,
            "made_by_coupling_j": force_j - motion_j,
            "script": _number(rules["src2-script"]["success"]),
            "rules": _number(rules["src2-rules"]["success"]),
            "four_script": _number(rules["src3-script"]["success"]),
            "four_rules": _number(rules["src3-rules"]["success"]),
            "failed": said[-1] if self.out["lead"]["failed"][0] else "",
        }


def _number(value: Any) -> float | None:
    return None if value.reason else value.value


def stitches(args: argparse.Namespace) -> None:
    rows = []
    for seed in range(args.first, args.first + args.seeds):
        row = Trial("suturing", [*args.set, f"scene.seed={seed}"]).run()
        rows.append(row)
        print(json.dumps({"seed": seed, **row}), flush=True)
    for name in ("entry_error_mean", "exit_error_mean", "force", "trauma", "simulated_s", "cpu_s"):
        found = [row[name] for row in rows if row[name] is not None]
        if found:
            print(f"{name}: median {np.median(found):.4g}, 90th {np.percentile(found, 90):.4g}")
    share = max(abs(row["made_by_coupling_j"] / row["exchanged_j"]) for row in rows if row["exchanged_j"])
    print(f"energy made by the coupling: at most {100 * share:.3f} % of what was exchanged")
    for name in ("script", "rules", "four_script", "four_rules"):
        print(f"{name}: {sum(row[name] or 0.0 for row in rows):.0f} of {len(rows)}")


ERRORS = "{within: [5 deg, 5 deg, 5 mm], seed: %d}"
"""As the Surgical Robotics Challenge has them."""
CLASSES = (
    "could not take the needle up",
    "has not taken hold",
    "has lost the needle",
    "is not feasible",
    "cannot be picked up",
    "tracker",
)
"""What a message of a failure contains."""


def success(args: argparse.Namespace) -> None:
    """Run the seeds that a file of rows does not have yet, append them, and print its table.

    A seed places the needle, chooses the pair of holes of a single stitch, and draws joint errors and noise.
    """
    file = Path(args.rows)
    rows: list[dict[str, Any]] = []
    if file.exists():
        rows = [json.loads(line) for line in file.read_text().splitlines()]
    for seed in sorted(set(range(args.first, args.first + args.seeds)) - {row["seed"] for row in rows}):
        first = 1 + seed % 4 if args.stitches == 1 else 1
        given = [f"scene.seed={seed}", f"participants.lead.stitches={args.stitches}"]
        given.append(f"participants.lead.first={first}")
        if args.errors:
            given.append(f"participants.motion.joint_errors={ERRORS % seed}")
        row = {"seed": seed, "first": first, **Trial("suturing", given).run()}
        rows.append(row)
        with file.open("a") as out:
            out.write(json.dumps(row) + "\n")
    succeeded = {"script": "four_script", "rules": "four_rules"} if args.stitches == 4 else {}
    for name in ("script", "rules"):
        print(f"{name}: {sum(row[succeeded.get(name, name)] or 0.0 for row in rows):.0f} of {len(rows)}")
    failed = [row for row in rows if row["failed"] or row["made"] != args.stitches]
    for row in failed:
        kind = next((each for each in CLASSES if each in row["failed"]), "out of time")
        print(f"seed {row['seed']}: {kind}: {row['failed']}")
    for name in ("entry_error_mean", "exit_error_mean", "simulated_s", "cpu_s"):
        found = [row[name] for row in rows if row[name] is not None]
        print(f"{name}: median {np.median(found):.4g}, 90th {np.percentile(found, 90):.4g}")


MIDDLE, BITES = 0.03, (0.008, 0.018)
"""m: either way from the pad's middle, and between the holes, within which a stitch is drawn."""


def drawn(rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Return entry and exit of a stitch of any direction, shape (3,), in the phantom's frame, m."""
    bite, way = rng.uniform(*BITES), rng.uniform(-pi, pi)
    middle = np.array([*rng.uniform(-MIDDLE, MIDDLE, 2), 0.0])
    half = bite / 2.0 * np.array([np.cos(way), np.sin(way), 0.0])
    return middle - half, middle + half


def guided(args: argparse.Namespace) -> None:
    """Let a program pick stitches of any direction, one for each seed that a file of rows does not have."""
    file = Path(args.rows)
    rows: list[dict[str, Any]] = []
    if file.exists():
        rows = [json.loads(line) for line in file.read_text().splitlines()]
    for seed in sorted(set(range(args.first, args.first + args.seeds)) - {row["seed"] for row in rows}):
        rows.append({"seed": seed, **_guided(seed)})
        with file.open("a") as out:
            out.write(json.dumps(rows[-1]) + "\n")
    made = [row for row in rows if row["made"]]
    print(f"made: {len(made)} of {len(rows)}")
    for row in rows:
        if not row["made"]:
            print(f"seed {row['seed']}: {row['said']}")
    for name in ("by one hand", "exchanged"):
        print(f"{name}: {sum(row[name] for row in made)}")
    for name in ("entry_mm", "exit_mm", "simulated_s"):
        found = [row[name] for row in made]
        print(f"{name}: median {np.median(found):.3g}, most {max(found):.3g}")


def _guided(seed: int) -> dict[str, Any]:
    trial, rng = Trial("suturing-by-hand", [f"scene.seed={seed}"]), np.random.default_rng(seed)
    holes, shape, said, tips = drawn(rng), NEEDLES["sh-plus"], list[str](), list[Vector]()
    surgeon = trial.parts["lead"]._surgeon
    for _ in range(1000):  # the needle comes to rest
        trial.step()
    for point in holes:
        there = Point(x=float(point[0]), y=float(point[1]))
        trial.send("lead", "operator/pick", PointStamped(header=Header(frame_id="phantom"), point=there))
    consented = False
    while trial.time_ns < 120_000_000_000 and (
        surgeon.guided.stage in (Stage.PROPOSED, Stage.RUNNING) or not said
    ):
        trial.step()
        if not trial.time_ns % 10_000_000:
            said += [message.data for message in trial.out["lead"]["status"]]
            if not consented and (named := re.search(r"consent (\w{8})\?", " ".join(said))):
                word, consented = StringMessage(data=f"consent {named[1]}"), True
                trial.send("lead", "operator/command", word)
            needle = pose_to_matrix(trial.out["robot"]["needle/pose"])
            tips.append(needle[:3, :3] @ shape.marks[2] + needle[:3, 3])
    said += [message.data for message in trial.out["lead"]["status"]]
    crossed = _crossings(np.array(tips))
    off = [
        1e3 * float(np.linalg.norm(crossed - hole, axis=1).min()) if len(crossed) else None for hole in holes
    ]
    return {
        "simulated_s": trial.time_ns * 1e-9,
        "made": bool(surgeon.state.made[0]),
        "entry_mm": off[0],
        "exit_mm": off[1],
        "by one hand": surgeon.handing.alone,
        "exchanged": surgeon.handing.exchanged,
        "said": said[-1] if said else "",
    }


def _crossings(tips: Vector) -> Vector:
    """Return where a way of the tip, shape (n, 3), goes through the skin, z = 0: shape (m, 3)."""
    before, after = tips[:-1], tips[1:]
    at = np.flatnonzero(before[:, 2] * after[:, 2] < 0.0)
    share = before[at, 2] / (before[at, 2] - after[at, 2])
    crossed: Vector = before[at] + share[:, None] * (after[at] - before[at])
    return crossed


def plans(args: argparse.Namespace) -> None:
    """Plan stitches of any direction, the needle as it lies at first, with and without handing it over."""
    file = load("suturing-by-hand", [])
    lead = _make("guided-stitching", "lead", file.params["lead"])
    surgeon, thing = lead._surgeon, file.params["robot"].objects["needle"]
    surgeon.sense(np.array([*thing.position, *thing.orientation]), 0.0)
    for number, hand in enumerate(surgeon.hands):
        start = np.array(file.params["lead"].arms.present_arms[hand.arm].start)
        hand.measured[:] = surgeon.state.park[number] = matrix_to_pose(hand.base @ hand.chain.forward(start))
    rng, took, plain = np.random.default_rng(0), list[float](), 0
    found: Counter[tuple[bool, bool, int]] = Counter()
    for _ in range(args.stitches):
        surgeon.guided.points[:], surgeon.guided.picked = drawn(rng), 2
        with suppress(MotionError):
            way_on(surgeon.params, *surgeon.hands, surgeon.stitch, surgeon.state.needle, 0.0)
            plain += 1
        began = time.perf_counter()
        with suppress(MotionError):
            plan = surgeon._way_on()
            found[plan.exchanged, plan.alone, len(plan.handed)] += 1
        took.append(time.perf_counter() - began)
    print(f"as planned: {plain} of {args.stitches}; with all that hands can do: {found.total()}")
    for (exchanged, alone, handed), count in sorted(found.items()):
        who = "the left hand" if exchanged else "the right hand"
        print(f"{count}: {who} drives{', and pulls' if alone else ''}, after {handed} hand-overs")
    print(f"to plan one: median {1e3 * np.median(took):.0f} ms, most {1e3 * max(took):.0f} ms")


def force(args: argparse.Namespace) -> None:
    """Turn a needle through the pad alone, and compare what it feels along the arc with the model's sum."""
    needle, tissue = NEEDLES["sh-plus"], TissueParams()
    entry, leave = np.array([8e-3, 0.0, 0.0]), np.array([-8e-3, 0.0, 0.0])
    stitch = stitch_between(entry, leave, np.array([0.0, 0.0, 1.0]), needle)
    channel, rows = Channel(needle, tissue), []
    for angle in np.arange(stitch.entry - 0.1, stitch.exit + 0.6, 0.004):
        pose = stitch.pose(float(angle))
        load, moment = channel.advance(pose[:3, :3], pose[:3, 3], over_pad=True)
        about = (moment - np.cross(pose[:3, 3], load)) @ pose[:3, 2]
        way = needle.radius * (angle - stitch.entry)
        rows.append((way, -about / needle.radius, channel.state.tip, float(channel.state.phase)))
    table = np.array(rows)
    bite = 2.0 * needle.radius * (pi / 2.0 - asin(sqrt(1.0 - (8e-3 / needle.radius) ** 2)))
    model = np.where(
        (table[:, 0] > 0) & (table[:, 3] == 2),
        tissue.cutting + tissue.friction * np.minimum(table[:, 0], bite),
        np.where(table[:, 3] == 3, tissue.friction * bite, 0.0),
    )
    entered, through = table[table[:, 3] < 2, 1].max(), table[table[:, 3] == 2, 1].max()
    print(f"largest at entry {entered:.3f} N, at exit {through:.3f} N")
    inside = (table[:, 3] == 2) & (table[:, 0] > 2e-3) & (table[:, 0] < bite - 1.5e-3)
    print(f"cutting and friction: RMS {np.sqrt(np.mean((table[inside, 1] - model[inside]) ** 2)):.4f} N off")
    if args.picture:
        import matplotlib.pyplot as plt

        plt.figure(figsize=(7, 3.5))
        plt.plot(table[:, 0] * 1e3, table[:, 1], label="felt along the arc")
        plt.plot(table[:, 0] * 1e3, model, "--", label="cutting + friction along the embedded arc")
        plt.xlabel("way of the tip since the skin, mm")
        plt.ylabel("force, N")
        plt.legend()
        plt.tight_layout()
        plt.savefig(args.picture, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(required=True)
    one = commands.add_parser("stitches")
    one.add_argument("--seeds", type=int, default=10)
    one.add_argument("--first", type=int, default=0)
    one.add_argument("--set", action="append", default=[])
    one.set_defaults(run=stitches)
    many = commands.add_parser("success")
    many.add_argument("--rows", required=True, help="file that the rows are appended to")
    many.add_argument("--seeds", type=int, default=40)
    many.add_argument("--first", type=int, default=0)
    many.add_argument("--stitches", type=int, choices=(1, 4), default=1)
    many.add_argument("--errors", action="store_true", help="with joint errors")
    many.set_defaults(run=success)
    picked = commands.add_parser("guided")
    picked.add_argument("--rows", required=True, help="file that the rows are appended to")
    picked.add_argument("--seeds", type=int, default=50)
    picked.add_argument("--first", type=int, default=0)
    picked.set_defaults(run=guided)
    planned = commands.add_parser("plans")
    planned.add_argument("--stitches", type=int, default=1000)
    planned.set_defaults(run=plans)
    two = commands.add_parser("force")
    two.add_argument("--picture")
    two.set_defaults(run=force)
    args = parser.parse_args()
    args.run(args)


if __name__ == "__main__":
    main()
