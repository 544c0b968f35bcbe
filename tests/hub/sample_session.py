"""A recorded palpation session made of formulas: a tip pressed three times against a spring with losses, and
its books.
"""

import json
from pathlib import Path

import numpy as np

from hub.recording.recorder import Recorder, RecorderSummary
from schemas.codec import encode
from schemas.keys import Keys, topic
from schemas.ports import BondSide, Port, bond_ports
from schemas.ros import Header, Time
from schemas.scenario import Scenario
from schemas.trocar_msgs import (
    AckMessage,
    CouplingEnergy,
    GrantMessage,
    InletSample,
    ParticipantStatus,
    SessionStatus,
)
from schemas.vectors import VectorCodec

STEP_NS = 1_000_000
BOND = "robot/PSM1/probe"
SCENARIO = {
    "name": "palpation",
    "description": "A hand palpates a soft block with PSM1 <and> retreats.",
    "step": "1 ms",
    "participants": {
        "stylus": {"kind": "scripted", "samples": "hand"},
        "robot": {"kind": "mujoco", "host": "robot"},
        "tissue": {"kind": "bullet", "host": "tissue"},
    },
    "bonds": [{"motion": "robot.PSM1/probe", "force": "tissue.probe", "algorithm": "impulse"}],
    "measure": {"peak_tissue_force_n": {"kind": "peak-norm", "of": "tissue.probe/wrench.force", "unit": "N"}},
}
ATTACHMENTS = {
    "scenario.yaml": json.dumps(SCENARIO, indent=2).encode(),
    "scenario.json": Scenario.model_validate(SCENARIO).model_dump_json().encode(),
    "versions.json": json.dumps({"trocar": "0.1.0", "mujoco": "4.0.0", "pybullet": "3.2.7"}).encode(),
    "files.json": json.dumps({"/data/hand/hand.mcap": "ab" * 32}).encode(),
}


def write_session(directory: Path, seconds: float = 0.5) -> RecorderSummary:
    """Record a session of `seconds` of simulated time."""
    keys = Keys("palpation")
    pose, twist, _ = (
        VectorCodec(port)
        for port in bond_ports(BondSide(name="PSM1/probe", side="motion", frame="PSM1_base"))
    )
    wrench = VectorCodec(bond_ports(BondSide(name="probe", side="force", frame="PSM1_base"))[2])
    stylus = VectorCodec(
        Port(name="pose", causality="output", type="geometry_msgs/msg/PoseStamped", frame="stylus_base")
    )
    steps = round(seconds * 1e9) // STEP_NS
    times, tip, force, powers = _press(steps, seconds)
    noise = np.random.default_rng(1)
    with Recorder(directory, attachments=ATTACHMENTS) as recorder:
        ports = {
            "pose": recorder.add_channel(
                topic(keys.output("engine", "robot", "PSM1/probe/pose")), pose.port.type
            ),
            "twist": recorder.add_channel(
                topic(keys.output("engine", "robot", "PSM1/probe/twist")), twist.port.type
            ),
            "wrench": recorder.add_channel(
                topic(keys.output("engine", "tissue", "probe/wrench")), wrench.port.type
            ),
            "stylus": recorder.add_channel(topic(keys.output("device", "stylus", "pose")), stylus.port.type),
            "grant": recorder.add_channel(topic(keys.grant), GrantMessage.ros_type),
            "robot": recorder.add_channel(topic(keys.ack("robot")), AckMessage.ros_type),
            "tissue": recorder.add_channel(topic(keys.ack("tissue")), AckMessage.ros_type),
            "energy": recorder.add_channel(topic(keys.energy(BOND)), CouplingEnergy.ros_type),
            "status": recorder.add_channel(topic(keys.status), SessionStatus.ros_type),
        }
        for step in range(steps):
            start, end = step * STEP_NS, (step + 1) * STEP_NS
            inlets = []
            if step % 4 == 0:
                sample = stylus.encode(np.append(5 * tip[step], [0, 0, 0, 1]), start)
                recorder.write(ports["stylus"], start, sample)
                inlets = [
                    InletSample(participant="stylus", port="pose", payload=np.frombuffer(sample, np.uint8))
                ]
            recorder.write(
                ports["grant"],
                start,
                encode(
                    GrantMessage(run=7, epoch=0, step=step, start_ns=start, horizon_ns=end, inlets=inlets)
                ),
            )
            recorder.write(ports["pose"], end, pose.encode(np.append(tip[step], [0, 0, 0, 1]), end))
            recorder.write(ports["twist"], end, twist.encode(np.zeros(6), end))
            recorder.write(ports["wrench"], end, wrench.encode(np.append(force[step], np.zeros(3)), end))
            for name, typical in (("robot", 70e3), ("tissue", 450e3)):
                compute = np.array(
                    [noise.lognormal(np.log(typical), 0.15 + 0.6 * (noise.random() < 0.01))], np.uint64
                )
                work = powers[name][step : step + 1]
                ack = AckMessage(
                    run=7,
                    epoch=0,
                    step=step,
                    state_hash=np.array([step], np.uint64),
                    compute_ns=compute,
                    work_j=work,
                )
                recorder.write(ports[name], end, encode(ack))
            given, taken = float(powers["robot"][step]), float(powers["tissue"][step])
            header = Header(stamp=Time.from_ns(end))
            book = CouplingEnergy(
                header=header, bond=BOND, motion_work_j=given, force_work_j=taken, residual_j=taken - given
            )
            recorder.write(ports["energy"], end, encode(book))
            if step % 100 == 99:
                recorder.write(
                    ports["status"], end, encode(_status(step + 1, steps, 1.4 + 0.2 * np.sin(times[step])))
                )
        return recorder.close()


def _press(steps: int, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Times (s), tip positions (m), reactions on the tip (N) and works (J) of three presses of growing depth
    along -z.
    """
    times = np.arange(1, steps + 1) * (STEP_NS * 1e-9)
    phase = 3 * times / seconds
    depth = (0.002 * (np.floor(phase) + 1) * np.sin(np.pi * (phase % 1)) ** 2) - 0.001
    speed = np.gradient(depth, times)
    push = np.where(depth > 0, np.maximum(0, 200 * depth + 2e4 * depth**2 + 2.0 * speed), 0)
    tip = np.stack([0.001 * np.sin(times), 0.01 + 0 * times, -0.1 - depth], axis=1)
    force = np.stack([0.02 * push, 0 * push, push], axis=1)
    work = np.cumsum(push * speed) * (STEP_NS * 1e-9)
    return times, tip, force, {"robot": work, "tissue": work + 2e-7 * np.cumsum(push) / max(1, steps)}


def _status(step: int, steps: int, factor: float) -> SessionStatus:
    return SessionStatus(
        session="palpation",
        run=7,
        state="done" if step == steps else "running",
        step=step,
        sim_time_ns=step * STEP_NS,
        real_time_factor=factor,
        late_steps=0,
        dropped_messages=0,
        participants=[ParticipantStatus(name="robot", role="engine", host="robot", pid=1, step=step)],
    )
