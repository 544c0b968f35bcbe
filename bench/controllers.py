"""Processor time of a controller's step without a session: motion, teleoperation and the dVRK's console.

    python bench/controllers.py [--steps 2000] [--rounds 5] [--only motion]

Of `motion` there are four arms on the cart: still, and under a stream or moves; `publishes` is a step in
which its states are due, `step` one in which they are not. The inputs are made before the clock starts. Each
row is what the fastest tenth of the steps stays below in the best round, in microseconds and in multiples of
a loop of 1000 empty iterations that is measured beside it: the multiples are what to compare between machines
and between versions.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from statistics import quantiles
from time import process_time
from typing import Any

import numpy as np

if str(Path(__file__).parent) in sys.path:  # not if run as a module
    sys.path.remove(str(Path(__file__).parent))  # else this very file is the package `controllers`

from controllers.dvrk_console.controller import DvrkConsole
from controllers.dvrk_console.params import DvrkConsoleParams
from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from controllers.teleoperation.controller import Teleoperation
from controllers.teleoperation.params import TeleoperationParams
from hub.participant import Inputs, Setup, Stepped
from robots.serial_chain import SerialChain
from schemas.crtk import OperatingState
from schemas.message import Message
from schemas.ros import Header, JointState, Joy, Point, Pose, PoseStamped, Quaternion
from schemas.vectors import Vector, VectorCodec

H = 1_000_000
SELDOM = 3_600_000_000_000
TOOL = {"instrument": "400006"}
ARMS = {"PSM1": TOOL, "PSM2": TOOL, "PSM3": TOOL, "ECM": {}}
REACH, FREQUENCY = 0.02, 1.0
"""rad and m, and Hz, of the sine that streams describe about home."""

Events = dict[str, tuple[Message, ...]]
Step = Callable[[int], None]
"""Makes step number i."""


class Stand:
    """A participant with its inputs, and what it has returned."""

    def __init__(self, participant: Stepped) -> None:
        self.participant = participant
        self.outputs: dict[str, Any] = dict(participant.configure(Setup(H, Path())))
        self.values = {
            port.name: VectorCodec(port).neutral.copy() if port.start is None else np.array(port.start)
            for port in participant.ports
            if port.causality == "input" and port.variability == "signal"
        }
        self.events: Events = {}
        self.inputs = Inputs(self.values, events=self.events)

    def step(self, i: int, events: Mapping[str, tuple[Message, ...]]) -> None:
        """Make step `i`, with `events`."""
        self.events.clear()
        self.events.update(events)
        self.outputs.update(self.participant.step(i * H, H, self.inputs))


class Motion(Stand):
    """Four arms whose robot is in every step where it was commanded to be."""

    def __init__(self, publish_ns: int) -> None:
        params = {
            "mounting": "cart",
            "arms": ARMS,
            "initial_state": "homed",
            "publish_period": f"{publish_ns} ns",
        }
        self.motion = MotionController("motion", MotionParams.model_validate(params))
        super().__init__(self.motion)
        self._commands = [
            (value, port.replace("sense/", "drive/").replace("measured_js", "servo_jp"))
            for port, value in self.values.items()
        ]
        self.mirror()

    def mirror(self) -> None:
        """Let the robot be where it is commanded to be."""
        for value, port in self._commands:
            command = self.outputs[port]
            value[: command.size] = command


def way(chain: SerialChain, home: Vector, i: int) -> Vector:
    """Return the joint positions of a stream at step `i`."""
    phase = 2.0 * np.pi * FREQUENCY * i * H * 1e-9
    return np.clip(home + REACH * np.sin(phase), chain.lower, chain.upper)


def pose_of(tip: Vector) -> PoseStamped:
    """Return the pose of a tip in its arm's base frame, as a message."""
    from robots import rotation

    x, y, z = tip[:3, 3].tolist()
    qx, qy, qz, qw = rotation.from_matrix(tip).tolist()
    return PoseStamped(
        pose=Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))
    )


def commands(stand: Motion, kind: str, count: int) -> list[Events]:
    """Return the events of `count` steps."""
    arms = stand.motion.params.arms.present_arms
    homes = {name: np.array(arm.home) for name, arm in arms.items()}
    if kind == "still":
        return [{}] * count
    if kind == "move_jp":  # a move of each arm every 200 steps, to and fro
        return [
            {
                f"{name}/move_jp": (JointState(position=homes[name] + (0.05 if i % 400 else -0.05)),)
                for name in arms
            }
            if not i % 200
            else {}
            for i in range(count)
        ]
    found: list[Events] = []
    for i in range(count):
        events: Events = {}
        for name, arm in arms.items():
            goal = way(arm.chain, homes[name], i)
            if kind == "servo_jp":
                events[f"{name}/servo_jp"] = (JointState(position=goal),)
            else:
                message = pose_of(arm.chain.forward(goal))
                events[f"{name}/servo_cp"] = (
                    message.model_copy(update={"header": Header(frame_id=f"{name}_base")}),
                )
        found.append(events)
    return found


def motion(kind: str, publish_ns: int, count: int) -> tuple[Step, Step]:
    """Return the step of four arms under commands of `kind`, and what follows it off the clock."""
    stand = Motion(publish_ns)
    events = commands(stand, kind, count)

    def step(i: int) -> None:
        stand.step(i, events[i % count])

    return step, lambda _: None if kind == "still" else stand.mirror()


def hashed(count: int) -> tuple[Step, Step]:  # noqa: ARG001
    """Return the state hash of four arms."""
    stand = Motion(SELDOM)
    return lambda _: void(stand.motion.state_hash()), lambda _: None


def void(_: object) -> None:
    """Do nothing with a result."""


def hand(*, touches: bool, **params: Any) -> Stand:
    """Return a teleoperation of PSM1 that follows; `touches`: tissue pushes on its tip."""
    stand = Stand(Teleoperation("hand", TeleoperationParams.model_validate(params)))
    stand.values["master"][:] = 0.3, -0.1, 0.2, 0.0, 0.0, 0.0, 1.0
    stand.values["base_in_view"][:] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    stand.values["measured_js"][2] = 0.12
    if touches:
        stand.values["tip_wrench"][:3] = 0.1, 0.0, 0.8
    held: Events = (
        {"buttons": (Joy(buttons=np.array([1, 0], np.int32)),)} if params.get("engage") == "held" else {}
    )
    stand.step(0, held | {"operating_state": (OperatingState(state="ENABLED", is_homed=True),)})
    return stand


def teleoperation(count: int, *, touches: bool, moves: bool, **params: Any) -> tuple[Step, Step]:
    """Return the step of one hand; `moves`: the hand does."""
    stand, start = hand(touches=touches, **params), np.zeros(7)
    start[:] = stand.values["master"]
    phases = 2.0 * np.pi * FREQUENCY * np.arange(count) * H * 1e-9
    samples = start + np.outer(np.sin(phases), [0.03, 0.02, 0.01, 0.0, 0.0, 0.0, 0.0])

    def bring(i: int) -> None:
        if moves:
            stand.values["master"] = samples[i % count]

    return lambda i: stand.step(i + 1, {}), bring


def console(count: int, *, led: bool) -> tuple[Step, Step]:  # noqa: ARG001
    """Return the step of an idle console of a dVRK, or of one whose arms are led."""
    names = ("PSM1", "PSM2", "PSM3", "ECM")
    params = {"arms": names, "teleoperations": ("MTMR_PSM1", "MTML_PSM2")}
    stand = Stand(DvrkConsole("console", DvrkConsoleParams.model_validate(params)))
    ready = (OperatingState(state="ENABLED", is_homed=True),)
    stand.step(0, {f"{name}/operating_state": ready for name in (*names, "MTMR", "MTML")})
    if led:
        stand.step(1, {"console/emulate_operator_present": (Joy(buttons=np.array([1], np.int32)),)})
    return lambda i: stand.step(i + 2, {}), lambda _: None


def rows(count: int) -> Iterator[tuple[str, Callable[[], tuple[Step, Step]]]]:
    """Yield what is measured: its name, and what makes it anew."""
    for kind in ("still", "servo_jp", "servo_cp", "move_jp"):
        yield f"motion {kind}, step", lambda kind=kind: motion(kind, SELDOM, count)
        yield f"motion {kind}, publishes", lambda kind=kind: motion(kind, H, count)
    yield "motion, state hash", lambda: hashed(count)
    follow: dict[str, Any] = {"orientation": "follow", "view": "camera", "engage": "held"}
    for name, moves, touches in (
        ("still", False, False),
        ("free", True, False),
        ("in contact", True, True),
    ):
        yield (
            f"teleoperation {name}",
            lambda m=moves, c=touches: teleoperation(count, moves=m, touches=c, **follow),
        )
    yield (
        "teleoperation in contact, contact_period 4 ms",
        lambda: teleoperation(count, moves=True, touches=True, contact_period="4 ms", **follow),
    )
    yield (
        "teleoperation free, velocity law",
        lambda: teleoperation(count, moves=True, touches=False, law="velocity"),
    )
    yield "dvrk console idle", lambda: console(count, led=False)
    yield "dvrk console with operator", lambda: console(count, led=True)


def microseconds(step: Step, after: Step, count: int) -> float:
    """Return the processor time of one step, the lowest tenth, without what follows it."""
    taken: list[float] = []
    for i in range(count):
        begun = process_time()
        step(i)
        taken.append(process_time() - begun)
        after(i)
    return quantiles(taken, n=10)[0] * 1e6


def reference() -> float:
    """Return the processor time (us) of 1000 iterations of an empty loop, the best of many."""
    best = 1.0
    for _ in range(50):
        begun = process_time()
        for _ in range(10_000):
            pass
        best = min(best, (process_time() - begun) / 10)
    return best * 1e6


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", default="", help="rows whose names contain this")
    arguments = parser.parse_args()
    print(f"{'':48} {'us':>8} {'x loop':>8}    loop: 1000 empty iterations, {reference():.1f} us")
    for name, make in rows(arguments.steps):
        if arguments.only not in name:
            continue
        best, ratio = np.inf, np.inf
        for _ in range(arguments.rounds):
            step, after = make()
            loop = reference()
            taken = microseconds(step, after, arguments.steps)
            best, ratio = min(best, taken), min(ratio, taken / loop)
        print(f"{name:48} {best:8.1f} {ratio:8.2f}", flush=True)


if __name__ == "__main__":
    main()
