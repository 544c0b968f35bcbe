"""A simulated hand that touches through a delayed link: does it come to rest, and does it feel what there is?

A hand (a mass on spring and damper, as in docs/decisions/0022) is told a way, holds a stylus that the real
haptic loop drives at 1 kHz, and leads a tip through a link with delay in both directions, jitter and loss.
The tip is a mass on a position servo against a contact law; the controller's contact model of it goes back to
the stylus. Every delay is tried on: a virtual table; springs soft and stiff; tissue that gets stiffer with
depth; tissue that damps; a hard thing; rubbing. For comparison, `--naive` sends the surface that the newest
force and the stiffest plane allowed imply. `--random` takes as many contacts, hands and links by chance and
prints those that swing by more than 0.5 mm. `--margin` prints the gain up to which the loop is stable at any
delay.

Figures: peak to peak of the hand in the last second and in the one before, and the hand's force at the end
against that at the tip.
"""

from __future__ import annotations

import argparse
import heapq
import json
import random
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from controllers.teleoperation.contact_model import ContactModelBuilder, ForceParams, PlaneParams
from devices.haptics.contact import planes_of
from devices.haptics.limits import Limits
from devices.haptics.loop import HapticLoop
from devices.simulated_touch.hand import SimulatedHand
from schemas.ros import Header, Vector3
from schemas.trocar_msgs import ContactModel, ContactPlane

TICK, PERIOD = 1e-3, 4e-3
"""s: of the device and of the controller."""
SERVO_STIFFNESS, TIP_MASS = 5e3, 0.5
"""N/m and kg: a tip on a critically damped servo of 16 Hz."""
TABLE = PlaneParams(normal=(0, 0, 1), distance=0.0, stiffness=200.0)


class Link:
    """One direction of a network: messages take `delay` and up to `jitter` longer, and overtake one another.

    The share `loss` is lost.
    """

    def __init__(self, delay: float, jitter: float, loss: float, chance: random.Random) -> None:
        self._way: list[tuple[float, int, object]] = []
        self._delay, self._jitter, self._loss, self._chance, self._sent = delay, jitter, loss, chance, 0

    def send(self, t: float, message: object) -> None:
        self._sent += 1
        if self._chance.random() >= self._loss:
            heapq.heappush(
                self._way, (t + self._delay + self._chance.random() * self._jitter, self._sent, message)
            )

    def pop_arrivals(self, t: float) -> Iterator[tuple[int, object]]:
        """Yield number and message of all that has come by `t`."""
        while self._way and self._way[0][0] <= t + 1e-9:
            yield heapq.heappop(self._way)[1:]


class Surface:
    """A contact law of a body below z = 0: the force on a tip, growing with depth to the `power`.

    `stiffness` is that at a depth of 3 mm.
    """

    def __init__(
        self, stiffness: float, *, power: float = 1.0, damping: float = 0.0, friction: float = 0.0
    ) -> None:
        self._stiffness, self._power, self._damping, self._friction = stiffness, power, damping, friction
        self._anchor: np.ndarray | None = None

    def force(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        if position[2] >= 0.0:
            self._anchor = None
            return np.zeros(3)
        push = max(
            0.0, self._stiffness * 3e-3 * (-position[2] / 3e-3) ** self._power - self._damping * velocity[2]
        )
        if self._anchor is None:
            self._anchor = position[:2].copy()
        rub = self._stiffness * (self._anchor - position[:2])
        size = np.linalg.norm(rub)
        if size > self._friction * push:
            rub *= self._friction * push / size
            self._anchor = position[:2] + rub / self._stiffness
        return np.array([*rub, push])


class Tip:
    """A mass on a servo that follows the command, against a surface."""

    def __init__(self, position: np.ndarray, surface: Surface | None) -> None:
        self._position, self._velocity, self._command, self._surface = (
            position.copy(),
            np.zeros(3),
            position.copy(),
            surface,
        )

    def follow(self, command: np.ndarray, substeps: int = 8) -> np.ndarray:
        """Go on for a period towards `command`; return the mean force of the surface."""
        total, dt, speed = np.zeros(3), PERIOD / substeps, (command - self._command) / PERIOD
        damping = 2.0 * np.sqrt(SERVO_STIFFNESS * TIP_MASS)
        for _ in range(substeps):
            self._command += speed * dt
            force = (
                np.zeros(3) if self._surface is None else self._surface.force(self._position, self._velocity)
            )
            servo = SERVO_STIFFNESS * (self._command - self._position) + damping * (speed - self._velocity)
            self._velocity += (servo + force) / TIP_MASS * dt
            self._position += self._velocity * dt
            total += force / substeps
        return total


@dataclass
class Naive:
    """Simplest: the newest force, as a spring of the largest allowed stiffness where the hand was."""

    stiffness: float = 400.0

    def planes(
        self,
        hand: np.ndarray,
        tip: np.ndarray,
        to_base: np.ndarray,
        scale: float,
        *,
        tip_wrench: np.ndarray,
        **_: object,
    ) -> list[ContactPlane]:
        force = tip_wrench[:3]
        size = float(np.linalg.norm(force))
        if not size:
            return []
        x, y, z = (force / size).tolist()
        return [
            ContactPlane(
                normal=Vector3(x=x, y=y, z=z),
                distance=float(force @ hand) / size + size / self.stiffness,
                stiffness=self.stiffness,
            )
        ]


@dataclass(frozen=True)
class Trial:
    """What is touched, by which hand, through which link, how."""

    surface: dict[str, float] | None = None
    """Arguments of `Surface`; None: the virtual table."""
    scale: float = 0.2
    delay: float = 0.0
    jitter: float = 0.01
    loss: float = 0.02
    depth: float = 0.015
    """Of the hand's goal below the surface, m."""
    slide: float = 0.0
    """Way along the surface, m."""
    hand: tuple[float, float, float] = (0.15, 200.0, 4.0)
    """kg, N/m, N s/m."""
    duration: float = 9.0

    def goal(self, t: float) -> tuple[float, float, float]:
        """Return the hand's target: 20 mm above, from 1.2 s on down at 50 mm/s, from 3 s on aside."""
        return (
            0.0,
            self.slide * min(max((t - 3.0) / 1.5, 0.0), 1.0),
            max(0.02 - max(0.0, t - 1.2) * 0.05, -self.depth),
        )

    def builder(self) -> ContactModelBuilder:
        return ContactModelBuilder(ForceParams(), [TABLE] if self.surface is None else [])


def run(trial: Trial, builder: ContactModelBuilder | Naive) -> np.ndarray:
    """Return rows of hand x, y, z (m), force on it (N), force on the tip (N), one for each tick."""
    chance = random.Random(1)
    up, down = (
        Link(trial.delay, trial.jitter if trial.delay else 0.0, trial.loss if trial.delay else 0.0, chance)
        for _ in range(2)
    )
    hand, loop = SimulatedHand(*trial.hand, TICK, trial.goal(0.0)), HapticLoop(Limits())
    tip = Tip(
        trial.scale * np.array(hand.position), None if trial.surface is None else Surface(**trial.surface)
    )
    newest, heard, touched, none = 0, hand.position, np.zeros(3), np.zeros(6)
    rows = np.empty((round(trial.duration / TICK), 9))
    for i, row in enumerate(rows):
        t = i * TICK
        up.send(t, hand.position)
        if i % round(PERIOD / TICK) == 0:
            for number, position in up.pop_arrivals(t):
                newest, heard = max((newest, heard), (number, position))
            command = trial.scale * np.array(heard)
            touched = tip.follow(command)
            wrench = np.array([*touched, 0.0, 0.0, 0.0])
            planes = builder.planes(
                np.array(heard),
                command,
                np.eye(3),
                trial.scale,
                following=True,
                tip_wrench=wrench,
                rigid_wrench=none,
                elapsed=PERIOD,
            )
            down.send(t + PERIOD, planes_of(ContactModel(header=Header(), planes=planes)))
        for number, planes in down.pop_arrivals(t):
            loop.receive(planes, number, t)
        force = loop.tick(t, hand.position, hand.velocity, permitted=True)
        row[:] = *hand.position, *force, *touched
        hand.move(force, trial.goal(t), (0.0, 0.0, 0.0))
    return rows


CASES = {
    "table, 200 N/m": Trial(scale=1.0),
    "table, stroked": Trial(scale=1.0, slide=0.02),
    "spring, 300 N/m": Trial({"stiffness": 300.0}),
    "spring, 1000 N/m": Trial({"stiffness": 1000.0}),
    "tissue, power 1.5": Trial({"stiffness": 500.0, "power": 1.5}),
    "tissue, damping 4 N s/m": Trial({"stiffness": 500.0, "power": 1.5, "damping": 4.0}),
    "tissue, rubbed": Trial({"stiffness": 500.0, "power": 1.5, "friction": 0.3}, slide=0.03),
    "hard, 20 kN/m": Trial({"stiffness": 2e4, "damping": 20.0}),
    "hard, rubbed": Trial({"stiffness": 2e4, "damping": 20.0, "friction": 0.3}, slide=0.03),
    "spring, 300 N/m, scale 1": Trial({"stiffness": 300.0}, scale=1.0),
}


def random_trials(count: int) -> Iterator[Trial]:
    """Yield contacts, hands and links as they may be."""
    chance = random.Random(1)
    for _ in range(count):
        surface = {"stiffness": 10 ** chance.uniform(1.7, 4.2), "power": chance.choice((1.0, 1.5, 2.0))}
        surface |= {
            "damping": chance.choice((0.0, 1.0, 4.0, 10.0)),
            "friction": chance.choice((0.0, 0.2, 0.4)),
        }
        yield Trial(
            surface,
            scale=chance.choice((0.1, 0.2, 0.4, 1.0)),
            delay=chance.choice((0.0, 0.07, 0.1, 0.2, 0.3)),
            jitter=chance.choice((0.0, 0.01, 0.03, 0.05)),
            loss=chance.choice((0.0, 0.02, 0.05, 0.2)),
            depth=chance.uniform(0.003, 0.02),
            slide=chance.choice((0.0, chance.uniform(0.005, 0.05))),
            hand=(
                chance.choice((0.1, 0.15, 0.3)),
                chance.choice((100.0, 200.0, 400.0)),
                chance.choice((2.0, 3.0, 4.0, 8.0)),
            ),
        )


def figures(rows: np.ndarray) -> dict[str, float]:
    """Return what the docstring of this file says."""
    second = round(1.0 / TICK)
    last, before = rows[-second:], rows[-2 * second : -second]
    swing = [float(np.ptp(part[:, :3], axis=0).max()) for part in (before, last)]
    norms = [float(np.linalg.norm(last[:, part], axis=1).mean()) for part in (slice(3, 6), slice(6, 9))]
    peak = float(np.linalg.norm(rows[:, 3:6], axis=1).max())
    return {
        "swing_before_m": swing[0],
        "swing_m": swing[1],
        "hand_force_n": norms[0],
        "tip_force_n": norms[1],
        "peak_hand_force_n": peak,
    }


def largest_gain(stiffness: float, settling: float) -> float:
    """Return the largest |1 - tangent / secant| at which the loop is stable for every delay.

    By the small-gain theorem (docs/decisions/0025).
    """
    s, (mass, grip, damping) = 1j * np.logspace(-1, 4, 200_001), Trial().hand
    damping += ForceParams().damping
    return float(
        np.min(np.abs((mass * s**2 + damping * s + grip + stiffness) * (1.0 + s * settling))) / stiffness
    )


def show_margins() -> None:
    for stiffness in (50.0, 100.0, 200.0, 400.0):
        print(
            f"plane of {stiffness:3g} N/m: gain below",
            ", ".join(f"{largest_gain(stiffness, t):.2f} at {t * 1e3:g} ms" for t in (0.02, 0.1)),
        )


def show_random(count: int, *, naive: bool) -> None:
    swinging = 0
    for trial in random_trials(count):
        found = figures(run(trial, Naive() if naive else trial.builder()))
        if found["swing_m"] > 0.5e-3:
            swinging += 1
            print(f"{1e3 * found['swing_m']:.2f} mm: {trial}")
    print(f"{swinging} of {count} swing by more than 0.5 mm")


def show_cases(delays_ms: list[float], *, naive: bool) -> dict[str, dict[str, dict[str, float]]]:
    results: dict[str, dict[str, dict[str, float]]] = {}
    for name, case in CASES.items():
        results[name] = {}
        for delay in delays_ms:
            trial = replace(case, delay=delay * 1e-3)
            found = results[name][f"{delay:g} ms"] = figures(
                run(trial, Naive() if naive and trial.surface else trial.builder())
            )
            swing = f"swing {1e3 * found['swing_before_m']:8.4f} {1e3 * found['swing_m']:8.4f} mm"
            force = (
                f"hand {found['hand_force_n']:.3f} N of {found['tip_force_n']:.3f}, peak"
                f" {found['peak_hand_force_n']:.3f}"
            )
            print(f"{name:26} {delay:4g} ms  {swing}   {force}", flush=True)
    return results


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--delays-ms", type=float, nargs="+", default=[0, 70, 100, 200, 300])
    parser.add_argument("--naive", action="store_true")
    parser.add_argument("--random", type=int, metavar="COUNT")
    parser.add_argument("--margin", action="store_true")
    parser.add_argument("--output", type=Path, help="JSON")
    args = parser.parse_args()
    if args.margin:
        show_margins()
    elif args.random:
        show_random(args.random, naive=args.naive)
    else:
        results = show_cases(args.delays_ms, naive=args.naive)
        if args.output:
            args.output.write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
