"""A simulated hand that touches through a delayed link: does it come to rest, and does it feel what there is?

A hand (a mass on spring and damper, as in docs/decisions/0022) is told a way, holds a stylus that the real haptic loop drives at
1 kHz, and leads a tip through a link with delay in both directions, jitter and loss. The tip is a mass on a position servo against a
contact law; the controller's contact model of it goes back to the stylus. Every delay is tried on: a virtual table; springs soft and
stiff; tissue that gets stiffer with depth; tissue that damps; a hard thing; rubbing. For comparison, `--naive` sends the surface that
the newest force and the stiffest plane allowed imply. `--margin` prints the gain up to which the loop is stable at any delay.

Figures: peak to peak of the hand in the last second and in the one before, and the hand's force at the end against that at the tip.
"""

from __future__ import annotations

import argparse
import heapq
import json
import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from controllers.teleoperation.contact_model import ContactModelBuilder, ForceParams, PlaneParams
from devices.haptics.contact import planes_of
from devices.haptics.limits import Limits
from devices.haptics.loop import HapticLoop
from devices.simulated_touch.hand import Hand
from schemas.ros import Header, Vector3
from schemas.trocar_msgs import ContactModel, ContactPlane

TICK, PERIOD, DURATION = 1e-3, 4e-3, 9.0
"""s: of the device, of the controller, of a run."""
MASS, GRIP, DAMPING = 0.15, 200.0, 4.0
"""kg, N/m, N s/m: of the hand."""
SERVO_STIFFNESS, TIP_MASS = 5e3, 0.5
"""N/m and kg: a tip on a critically damped servo of 16 Hz."""
TABLE = PlaneParams(normal=(0, 0, 1), distance=0.0, stiffness=200.0)


class Link:
    """One direction: messages take `delay` and up to `jitter` longer, and overtake one another; the share `loss` never comes."""

    def __init__(self, delay: float, jitter: float, loss: float, chance: random.Random) -> None:
        self._way: list[tuple[float, int, object]] = []
        self._delay, self._jitter, self._loss, self._chance, self._sent = delay, jitter, loss, chance, 0

    def send(self, t: float, message: object) -> None:
        self._sent += 1
        if self._chance.random() >= self._loss:
            heapq.heappush(self._way, (t + self._delay + self._chance.random() * self._jitter, self._sent, message))

    def arrived(self, t: float) -> Iterator[tuple[int, object]]:
        """Yield number and message of all that has come by `t`."""
        while self._way and self._way[0][0] <= t + 1e-9:
            yield heapq.heappop(self._way)[1:]


class Surface:
    """A contact law of a body below z = 0: the force on a tip, `stiffness` at 3 mm deep, growing with depth to the `power`."""

    def __init__(self, stiffness: float, *, power: float = 1.0, damping: float = 0.0, friction: float = 0.0) -> None:
        self._stiffness, self._power, self._damping, self._friction = stiffness, power, damping, friction
        self._anchor: np.ndarray | None = None

    def force(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        if position[2] >= 0.0:
            self._anchor = None
            return np.zeros(3)
        push = max(0.0, self._stiffness * 3e-3 * (-position[2] / 3e-3) ** self._power - self._damping * velocity[2])
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
        self._position, self._velocity, self._command, self._surface = position.copy(), np.zeros(3), position.copy(), surface

    def follow(self, command: np.ndarray, substeps: int = 8) -> np.ndarray:
        """Go on for a period towards `command`; return the mean force of the surface."""
        total, dt, speed = np.zeros(3), PERIOD / substeps, (command - self._command) / PERIOD
        damping = 2.0 * np.sqrt(SERVO_STIFFNESS * TIP_MASS)
        for _ in range(substeps):
            self._command += speed * dt
            force = np.zeros(3) if self._surface is None else self._surface.force(self._position, self._velocity)
            servo = SERVO_STIFFNESS * (self._command - self._position) + damping * (speed - self._velocity)
            self._velocity += (servo + force) / TIP_MASS * dt
            self._position += self._velocity * dt
            total += force / substeps
        return total


@dataclass
class Naive:
    """What comes to mind first: the newest force, as a spring of the largest stiffness allowed, where the hand was then."""

    stiffness: float = 400.0

    def planes(self, hand: np.ndarray, tip: np.ndarray, to_base: np.ndarray, scale: float, *, tip_wrench: np.ndarray, **_: object) -> list[ContactPlane]:
        force = tip_wrench[:3]
        size = float(np.linalg.norm(force))
        if not size:
            return []
        x, y, z = (force / size).tolist()
        return [ContactPlane(normal=Vector3(x=x, y=y, z=z), distance=float(force @ hand) / size + size / self.stiffness, stiffness=self.stiffness)]


def way(t: float, depth: float, slide: float) -> tuple[float, float, float]:
    """Return where the hand wants to be: 20 mm above, from 1.2 s on down at 50 mm/s, from 3 s on aside."""
    return 0.0, slide * min(max((t - 3.0) / 1.5, 0.0), 1.0), max(0.02 - max(0.0, t - 1.2) * 0.05, -depth)


def run(surface: Surface | None, builder: ContactModelBuilder | Naive, *, scale: float, delay: float, depth: float, slide: float) -> np.ndarray:
    """Return rows of hand x, y, z (m), the force on it (N), and the force on the tip (N), one for each tick."""
    chance = random.Random(1)
    up, down = (Link(delay, 0.01 if delay else 0.0, 0.02 if delay else 0.0, chance) for _ in range(2))
    hand, loop = Hand(MASS, GRIP, DAMPING, TICK, way(0.0, depth, slide)), HapticLoop(Limits())
    tip, newest, heard, touched, none = Tip(scale * np.array(hand.position), surface), 0, hand.position, np.zeros(3), np.zeros(6)
    rows = np.empty((round(DURATION / TICK), 9))
    for i, row in enumerate(rows):
        t = i * TICK
        up.send(t, hand.position)
        if i % round(PERIOD / TICK) == 0:
            for number, position in up.arrived(t):
                newest, heard = max((newest, heard), (number, position))
            command = scale * np.array(heard)
            touched = tip.follow(command)
            wrench = np.array([*touched, 0.0, 0.0, 0.0])
            planes = builder.planes(np.array(heard), command, np.eye(3), scale, following=True, tip_wrench=wrench, rigid_wrench=none, elapsed=PERIOD)
            down.send(t + PERIOD, planes_of(ContactModel(header=Header(), planes=planes)))
        for number, planes in down.arrived(t):
            loop.receive(planes, number, t)
        force = loop.tick(t, hand.position, hand.velocity, permitted=True)
        row[:] = *hand.position, *force, *touched
        hand.move(force, way(t, depth, slide), (0.0, 0.0, 0.0))
    return rows


CASES: dict[str, tuple[Callable[[], Surface | None], float, float]] = {
    "table, 200 N/m": (lambda: None, 1.0, 0.0),
    "table, stroked": (lambda: None, 1.0, 0.02),
    "spring, 300 N/m": (lambda: Surface(300.0), 0.2, 0.0),
    "spring, 1000 N/m": (lambda: Surface(1000.0), 0.2, 0.0),
    "tissue, power 1.5": (lambda: Surface(500.0, power=1.5), 0.2, 0.0),
    "tissue, damping 4 N s/m": (lambda: Surface(500.0, power=1.5, damping=4.0), 0.2, 0.0),
    "tissue, rubbed": (lambda: Surface(500.0, power=1.5, friction=0.3), 0.2, 0.03),
    "hard, 20 kN/m": (lambda: Surface(2e4, damping=20.0), 0.2, 0.0),
    "hard, rubbed": (lambda: Surface(2e4, damping=20.0, friction=0.3), 0.2, 0.03),
    "spring, 300 N/m, scale 1": (lambda: Surface(300.0), 1.0, 0.0),
}


def figures(rows: np.ndarray) -> dict[str, float]:
    """Return what the docstring of this file says."""
    second = round(1.0 / TICK)
    last, before = rows[-second:], rows[-2 * second : -second]
    swing = [float(np.ptp(part[:, :3], axis=0).max()) for part in (before, last)]
    norms = [float(np.linalg.norm(last[:, part], axis=1).mean()) for part in (slice(3, 6), slice(6, 9))]
    peak = float(np.linalg.norm(rows[:, 3:6], axis=1).max())
    return {"swing_before_m": swing[0], "swing_m": swing[1], "hand_force_n": norms[0], "tip_force_n": norms[1], "peak_hand_force_n": peak}


def largest_gain(stiffness: float, settling: float) -> float:
    """Return the largest |1 - tangent / secant| at which the loop is stable whatever the delay, by the small-gain theorem (docs/decisions/0025)."""
    s = 1j * np.logspace(-1, 4, 200_001)
    return float(np.min(np.abs((MASS * s**2 + DAMPING * s + GRIP + stiffness) * (1.0 + s * settling))) / stiffness)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--delays-ms", type=float, nargs="+", default=[0, 70, 100, 200, 300])
    parser.add_argument("--depth-mm", type=float, default=15.0, help="of the hand's goal below the surface")
    parser.add_argument("--naive", action="store_true")
    parser.add_argument("--margin", action="store_true")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--output", type=Path)
    args = parser.parse_args()
    if args.margin:
        for stiffness in (50.0, 100.0, 200.0, 400.0):
            print(f"plane of {stiffness:3g} N/m: gain below", ", ".join(f"{largest_gain(stiffness, t):.2f} at {t * 1e3:g} ms" for t in (0.02, 0.1)))
        return
    results: dict[str, dict[str, dict[str, float]]] = {}
    for name, (surface, scale, slide) in CASES.items():
        results[name] = {}
        for delay in args.delays_ms:
            builder = Naive() if args.naive else ContactModelBuilder(ForceParams(), [TABLE] if surface() is None else [])
            rows = run(surface(), builder, scale=scale, delay=delay * 1e-3, depth=args.depth_mm * 1e-3, slide=slide)
            found = results[name][f"{delay:g} ms"] = figures(rows)
            if not args.json:
                swing = f"swing {1e3 * found['swing_before_m']:8.4f} {1e3 * found['swing_m']:8.4f} mm"
                force = f"hand {found['hand_force_n']:.3f} N of {found['tip_force_n']:.3f}, peak {found['peak_hand_force_n']:.3f}"
                print(f"{name:26} {delay:4g} ms  {swing}   {force}")
    if args.output:
        args.output.write_text(json.dumps(results, indent=2) + "\n")
    if args.json:
        print(json.dumps(results))


if __name__ == "__main__":
    main()
