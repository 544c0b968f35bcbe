"""Small participants for the tests of the hub. Child processes find them as `toys:Name` through PYTHONPATH.

Their states are chaotic or chained hashes, so that a value that arrives a step too early or too late, twice
or not at all, changes every state hash from there on.
"""

from __future__ import annotations

import ctypes
import os
import signal
import time
from pathlib import Path
from typing import Literal

import numpy as np

from hub.participant import Controller, Device, ForceSide, MotionSide, Params, Sample, Stepped, state_hash
from schemas.ports import BondSide, Port
from schemas.ros import Float64MultiArray, Header, Joy, Point, Pose, PoseStamped, StringMessage, Time
from schemas.trocar_msgs import SoftBodyState

SIZE = 3
POSE, JOY, TEXT = PoseStamped.ros_type, Joy.ros_type, StringMessage.ros_type


class Bare(Stepped):
    """No ports, no state."""

    ports = ()

    def configure(self, setup):
        return {}

    def step(self, t, h, inputs):
        return {}

    def state_hash(self):
        return 0

    def close(self):
        pass


class MixerParams(Params):
    out_every: int = 1
    """The output comes at this many of its own steps."""
    step_ns: int = 1_000_000
    """Its own step; needed to state the output's period."""
    seed: int = 1


class Mixer(Bare):
    """Folds three inputs into a chaotic state, and publishes it."""

    params_model = MixerParams

    @property
    def ports(self):
        inputs = (Port(name=name, causality="input", size=SIZE, start=(0.25,) * SIZE) for name in "abc")
        return (
            *inputs,
            Port(
                name="out",
                causality="output",
                size=SIZE,
                period_ns=self.params.step_ns * self.params.out_every,
            ),
        )

    def configure(self, setup):
        self.x = np.random.default_rng(self.params.seed).random(SIZE)
        return {"out": self.x}

    def step(self, t, h, inputs):
        middle = h * 0.5e-9
        taken = inputs["a"] + 2.0 * inputs.at("b", middle) + 3.0 * inputs.at("c", middle)
        slope = sum(float(rate.sum()) for name in "bc" if (rate := inputs.rate(name)) is not None)
        # in place: neighbours must not see it early
        self.x[:] = (3.9 * self.x * (1.0 - self.x) + 0.1 * taken + 1e-4 * slope + h * 1e-12) % 1.0
        return {"out": self.x}

    def state_hash(self):
        return state_hash(self.x)


class Counter(Bare):
    """Publishes the number of its step every second step: no value comes twice."""

    ports = (Port(name="number", causality="output", size=1, period_ns=2_000_000),)

    def configure(self, setup):
        self.number = np.zeros(1)
        return {"number": self.number}

    def step(self, t, h, inputs):
        self.number += 1.0
        return {"number": self.number}

    def state_hash(self):
        return state_hash(self.number)


class Chain(Bare):
    """A state that is a hash of everything so far."""

    def configure(self, setup):
        self.digest = 0
        return {}

    def fold(self, *parts):
        self.digest = state_hash(self.digest.to_bytes(8, "little"), *parts)

    def state_hash(self):
        return self.digest


class Loud(Bare):
    """Publishes 32 KiB in each step."""

    ports = (Port(name="out", causality="output", size=4096),)

    def configure(self, setup):
        return {"out": np.zeros(4096)}

    def step(self, t, h, inputs):
        return {"out": np.zeros(4096)}


class Talker(Chain):
    """Publishes 0 to 4 words in a step."""

    ports = (Port(name="words", causality="output", type=TEXT, variability="event"),)

    def configure(self, setup):
        super().configure(setup)
        self.said = 0
        return {"words": ()}

    def step(self, t, h, inputs):
        count = (self.digest >> 3) % 5
        words = tuple(StringMessage(data=f"word {self.said + i}") for i in range(count))
        self.said += count
        self.fold(t.to_bytes(8, "little"))
        return {"words": words}


class Listener(Chain):
    """Expects every word of a `Talker` once and in order; `heard` counts them."""

    ports = (
        Port(name="words", causality="input", type=TEXT, variability="event"),
        Port(name="heard", causality="output", type="std_msgs/msg/Float64"),
    )

    def configure(self, setup):
        super().configure(setup)
        self.heard = np.zeros(1)
        return {"heard": self.heard}

    def step(self, t, h, inputs):
        for word in inputs.events("words"):
            if word.data != f"word {int(self.heard[0])}":
                raise ValueError(f"expected word {int(self.heard[0])}, got {word.data}")
            self.heard[0] += 1
        self.fold(t.to_bytes(8, "little"), self.heard)
        return {"heard": self.heard}


class Ledger(Chain):
    """Writes down every message that two signals have made; `entries` counts them."""

    ports = (
        *(Port(name=name, causality="input", variability="event") for name in "ab"),
        Port(name="entries", causality="output", type="std_msgs/msg/Float64"),
    )

    def configure(self, setup):
        super().configure(setup)
        self.entries = np.zeros(1)
        return {"entries": self.entries}

    def step(self, t, h, inputs):
        messages = [*inputs.events("a"), *inputs.events("b")]
        self.entries[0] += len(messages)
        self.fold(t.to_bytes(8, "little"), *(message.data for message in messages))
        return {"entries": self.entries}


class Follower(Chain):
    """Reads a device: a pose, its staleness, and buttons of which none may be lost."""

    ports = (
        Port(name="hand", causality="input", type=POSE),
        Port(name="buttons", causality="input", type=JOY, variability="event"),
        Port(name="pressed", causality="output", type="std_msgs/msg/Float64"),
        Port(name="stale_steps", causality="output", type="std_msgs/msg/Float64"),
    )

    def configure(self, setup):
        super().configure(setup)
        self.pressed, self.stale_steps = np.zeros(1), np.zeros(1)
        return {"pressed": self.pressed, "stale_steps": self.stale_steps}

    def step(self, t, h, inputs):
        for joy in inputs.events("buttons"):
            if joy.buttons[0] != self.pressed[0]:
                raise ValueError(f"expected press {self.pressed[0]}, got {joy.buttons[0]}")
            self.pressed[0] += 1
        self.stale_steps[0] += inputs.stale("hand")
        self.fold(inputs["hand"], self.pressed, self.stale_steps)
        return {"pressed": self.pressed, "stale_steps": self.stale_steps}


class SumParams(Params):
    gain: float = 1.0
    offset: float = 0.0


class Sum(Controller):
    """Adds up where a hand is while it is fresh; it can save its state."""

    params_model = SumParams

    @property
    def ports(self):
        return (
            Port(name="hand", causality="input", type=POSE),
            Port(name="offset", causality="input", start=(self.params.offset,)),
            Port(name="total", causality="output", size=SIZE),
        )

    def configure(self, setup):
        self.total = np.zeros(SIZE)  # sum, steps in which the hand was stale, steps
        self.keep(self.total)
        return {"total": self.total}

    def step(self, t, h, inputs):
        stale = inputs.stale("hand")
        moved = 0.0 if stale else self.params.gain * inputs["hand"][0]
        self.total += moved + inputs["offset"][0], stale, 1.0
        return {"total": self.total}


class Deaf(Bare):
    """Counts the fresh samples and the buttons of a device; its state does not depend on them."""

    ports = (
        Port(name="hand", causality="input", type=POSE),
        Port(name="buttons", causality="input", type=JOY, variability="event"),
        Port(name="fresh_steps", causality="output", type="std_msgs/msg/Float64"),
        Port(name="pressed", causality="output", type="std_msgs/msg/Float64"),
    )

    def configure(self, setup):
        self.fresh_steps, self.pressed = np.zeros(1), np.zeros(1)
        return {"fresh_steps": self.fresh_steps, "pressed": self.pressed}

    def step(self, t, h, inputs):
        self.fresh_steps[0] += not inputs.stale("hand")
        self.pressed[0] += len(inputs.events("buttons"))
        return {"fresh_steps": self.fresh_steps, "pressed": self.pressed}


class PlayerParams(Params):
    clock: Literal["simulated", "wall"] = "simulated"
    silent_after_ms: int = 10**9
    max_age_ms: int = 0
    fails: Literal["", "open", "read"] = ""


class Player(Device):
    """A pose every 3 ms and a button every 2 ms, in simulated or wall time."""

    params_model = PlayerParams

    @property
    def ports(self):
        clock, age = self.params.clock, self.params.max_age_ms * 1_000_000
        return (
            Port(
                name="hand", causality="output", type=POSE, frame="stylus_base", clock=clock, max_age_ns=age
            ),
            Port(name="buttons", causality="output", type=JOY, variability="event", clock=clock),
            Port(name="noise", causality="input", size=4096),
        )

    def open(self, directory):
        if self.params.fails == "open":
            raise OSError("the cable is out")
        self.next = {"hand": 0, "buttons": 0}

    def read(self, t):
        if self.params.fails == "read" and t > 50_000_000:
            raise OSError("the cable is out")
        made = []
        while (ms := self.next["hand"]) <= min(t // 1_000_000, self.params.silent_after_ms):
            pose = Pose(position=Point(x=ms / 7.0))
            made.append(
                (
                    ms,
                    Sample(
                        "hand",
                        PoseStamped(
                            header=Header(stamp=Time.from_ns(ms * 1_000_000), frame_id="stylus_base"),
                            pose=pose,
                        ),
                    ),
                )
            )
            self.next["hand"] += 3
        while (ms := self.next["buttons"]) <= t // 1_000_000:
            joy = Joy(
                header=Header(stamp=Time.from_ns(ms * 1_000_000)), buttons=np.array([ms // 2], np.int32)
            )
            made.append((ms, Sample("buttons", joy)))
            self.next["buttons"] += 2
        return [sample for _, sample in sorted(made, key=lambda row: row[0])]

    def close(self):
        pass


class Hand(Device):
    """Lives in simulated time; `out` folds the numbers written to it, the time, and the count of words."""

    ports = (
        Port(name="numbers", causality="input", size=SIZE),
        Port(name="words", causality="input", type=TEXT, variability="event"),
        Port(name="out", causality="output", size=SIZE, max_age_ns=20_000_000),
        Port(name="unused", causality="output", type=TEXT, variability="event"),
    )

    def open(self, directory):
        self.folded, self.heard = np.zeros(SIZE), 0

    def write(self, port, value):
        if port == "words":
            assert value.data == f"word {self.heard}"
            self.heard += 1
        else:
            self.folded = (0.5 * self.folded + value) % 1.0

    def read(self, t):
        value = self.folded + np.array([0.0, t * 1e-9, 1e-3 * self.heard])
        return [Sample("out", Float64MultiArray(data=value)), Sample("unused", StringMessage(data=f"{t}"))]

    def close(self):
        pass


class PadParams(Params):
    file: str


class Pad(Device):
    """Writes to a file, a line each, what it receives: words, and messages made of a signal."""

    params_model = PadParams
    ports = (
        Port(name="words", causality="input", type=TEXT, variability="event"),
        Port(name="numbers", causality="input", variability="event"),
    )

    def open(self, directory):
        Path(self.params.file).touch()

    def read(self, t):
        return ()

    def write(self, port, value):
        with Path(self.params.file).open("a") as file:
            file.write(f"{port} {value.data if port == 'words' else value.data.tolist()}\n")

    def close(self):
        pass


class Slow(Device):
    """Takes 20 ms for a write."""

    ports = (Port(name="numbers", causality="input", size=SIZE),)

    def open(self, directory):
        pass

    def read(self, t):
        return ()

    def write(self, port, value):
        time.sleep(0.02)

    def close(self):
        pass


class FaultParams(Params):
    at: int = 5
    how: Literal["configure", "raise", "nan", "shape", "hang", "exit", "kill", "interrupt"] = "raise"
    stamp: str = ""
    """File that gets the time (ns, monotonic) just before `kill`."""


class InterruptedArgument(ctypes.c_int):
    """An argument of C that is converted as the process is interrupted."""

    @classmethod
    def from_param(cls, value):
        os.kill(os.getpid(), signal.SIGTERM)
        for _ in range(1000):
            time.sleep(0.001)  # the signal is handled here
        return value


class Fault(Bare):
    """Goes wrong at step `at`, which its input does not change."""

    params_model = FaultParams
    ports = (
        Port(name="a", causality="input", size=SIZE, start=(0.0,) * SIZE),
        Port(name="out", causality="output", size=SIZE),
    )

    def configure(self, setup):
        if self.params.how == "configure":
            raise OSError("the robot is not plugged in")
        self.steps = 0
        return {"out": np.zeros(SIZE)}

    def step(self, t, h, inputs):
        wrong = self.steps == self.params.at
        self.steps += 1
        return self._go_wrong() if wrong else {"out": inputs["a"] + self.steps}

    def _go_wrong(self):
        how = self.params.how
        if how == "raise":
            raise ArithmeticError("the rope is torn")
        if how == "hang":
            while True:
                time.sleep(1000.0)
        if how == "exit":
            os._exit(7)
        if how == "interrupt":
            ctypes.CFUNCTYPE(None, InterruptedArgument)()(0)
        if how == "kill":
            Path(self.params.stamp).write_text(str(time.monotonic_ns()))
            os.kill(os.getpid(), signal.SIGKILL)
        return {"out": np.zeros(SIZE - 1) if how == "shape" else np.array([0.0, np.nan, 0.0])}

    def state_hash(self):
        return self.steps


class PacedParams(MixerParams):
    milliseconds: float = 1.0


class Paced(Mixer):
    """A mixer whose steps take a while."""

    params_model = PacedParams

    def step(self, t, h, inputs):
        time.sleep(self.params.milliseconds * 1e-3)
        return super().step(t, h, inputs)


class BusyParams(Params):
    burn_ms: float = 0.0
    """Of a core, in each step."""
    sleep_ms: float = 0.0
    """In each step."""
    hash_sleep_ms: float = 0.0
    """While its state is hashed."""


class Busy(Chain):
    """Takes time."""

    params_model = BusyParams

    def step(self, t, h, inputs):
        time.sleep(self.params.sleep_ms * 1e-3)
        until = time.thread_time() + self.params.burn_ms * 1e-3
        while time.thread_time() < until:
            pass
        self.fold(t.to_bytes(8, "little"))
        return {}

    def state_hash(self):
        time.sleep(self.params.hash_sleep_ms * 1e-3)
        return super().state_hash()


class MassParams(Params):
    mass: float = 1.0
    x: float = 1.0
    nan_at: int = -1


class Mass(Bare):
    """A free mass under the force of a bond."""

    params_model = MassParams

    @property
    def bonds(self):
        return (BondSide(name="tip", side="motion", dof=1, effective_mass=self.params.mass),)

    def configure(self, setup):
        self.side = MotionSide(self.bonds[0], setup.bonds["tip"])
        self.x, self.v, self.steps = np.array([self.params.x]), np.zeros(1), 0
        return self.side.result(self.x.copy(), self.v.copy())

    def step(self, t, h, inputs):
        self.side.begin(inputs, self.x, self.v)
        force, before = self.side.force(0.0, self.x, self.v), self.x
        self.v = self.v + h * 1e-9 * force / self.params.mass
        self.x = self.x + h * 1e-9 * self.v
        self.side.add(force, self.x - before)
        self.steps += 1
        outputs = self.side.result(self.x.copy(), self.v.copy())
        return outputs | (
            {self.side.work_port: np.array([np.nan])} if self.steps == self.params.nan_at + 1 else {}
        )

    def state_hash(self):
        return state_hash(self.x, self.v, self.side.state)


class Spring(Bare):
    """A spring-damper to the ground at the other end of a bond."""

    bonds = (BondSide(name="tip", side="force", dof=1, stiffness=100.0, damping=1.0, proxy_mass=0.1),)

    def configure(self, setup):
        self.side = ForceSide(self.bonds[0], setup.bonds["tip"])
        return {self.side.force_port: np.zeros(1), self.side.work_port: np.zeros(1)}

    def step(self, t, h, inputs):
        s = h * 1e-9
        self.side.begin(inputs, s)
        self.side.add(100.0 * self.side.position(0.5 * s), 1.0 * self.side.velocity(0.5 * s), 0.5 * s, s)
        return self.side.result(100.0 * self.side.position(s), 1.0 * self.side.velocity(s))

    def state_hash(self):
        return state_hash(self.side.state)


class CameraParams(Params):
    milliseconds: float = 0.0
    file: str = ""
    """Gets the process id, and then, with it, what it shows."""
    dies: Literal["", "raise", "kill"] = ""
    """At the first state after that at time 0."""


class Camera(Bare):
    """Looks at numbers and the nodes of a soft body; shows `time, number, nodes, triangles` of each state."""

    observer = True
    params_model = CameraParams
    ports = (
        Port(name="numbers", causality="input", size=SIZE),
        Port(name="nodes", causality="input", type=SoftBodyState.ros_type),
        Port(name="seen", causality="output", type=TEXT, variability="event"),
    )

    def configure(self, setup):
        self.triangles = 0
        if self.params.file:
            Path(self.params.file).write_text(str(os.getpid()))
        return {"seen": ()}

    def step(self, t, h, inputs):
        if t and self.params.dies == "raise":
            raise ArithmeticError("the lens is broken")
        if t and self.params.dies == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        time.sleep(self.params.milliseconds * 1e-3)
        nodes = inputs.message("nodes")
        self.triangles += nodes.triangles.size
        if not self.triangles:
            raise ValueError("the surface is missing")
        text = f"{t} {inputs['numbers'][0]:g} {nodes.nodes_m[0]:g} {self.triangles}"
        if self.params.file:
            Path(self.params.file).write_text(f"{os.getpid()} {text}")
        return {"seen": (StringMessage(data=text),)}


class Jelly(Bare):
    """A soft body whose first node and number are the step; its surface comes with the first message."""

    ports = (
        Port(name="numbers", causality="output", size=SIZE),
        Port(name="nodes", causality="output", type=SoftBodyState.ros_type),
    )

    def configure(self, setup):
        self.steps = 0
        return self.outputs(np.array([0, 1, 2], np.uint32))

    def outputs(self, triangles):
        nodes = SoftBodyState(
            header=Header(frame_id="world"),
            body="jelly",
            nodes_m=np.full(9, self.steps, np.float32),
            triangles=triangles,
        )
        return {"numbers": np.full(SIZE, float(self.steps)), "nodes": nodes}

    def step(self, t, h, inputs):
        self.steps += 1
        return self.outputs(np.zeros(0, np.uint32))

    def state_hash(self):
        return self.steps
