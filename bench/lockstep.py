"""The cost of a step without any computation, beside a bare Zenoh exchange of the same payload.

Both are measured in the same run. Window 1: N participants in processes of their own, 64 doubles from
neighbour to neighbour, the hub in the loop at every step; beside it a bare star, in which the hub sends 64
doubles to all and waits for 64 doubles from each. Window K > 1: one grant every K steps; beside it a bare
ring, in which each process waits for its neighbour alone. With --one-host all participants live in the hub's
process; beside it the same calls in a plain loop.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import struct
import subprocess
import sys
from pathlib import Path
from time import perf_counter, sleep

import zenoh
from zenoh.handlers import FifoChannel

from hub.participant import Params
from hub.session.launch import plan_of
from hub.session.session import Session
from hub.transport.loopback_port import LoopbackPort
from hub.transport.zenoh_session import open_session
from schemas.scenario import Scenario

PAYLOAD = bytes(64 * 8)
HEAD = struct.Struct("<QI")
QOS = {
    "congestion_control": zenoh.CongestionControl.BLOCK,
    "priority": zenoh.Priority.REAL_TIME,
    "express": True,
}


def trocar(participants: int, window: int, steps: int, *, one_host: bool) -> float:
    """Return the steps per second of a session."""
    names = [f"p{i}" for i in range(participants)]
    scenario = Scenario.model_validate(
        {
            "name": f"lockstep_{os.getpid()}",
            "step": "1 ms",
            "duration": steps * 1e-3,
            "window": window,
            "algorithm": "jacobi",
            "participants": {
                name: {"kind": "lockstep_participant:Exchange", "host": "hub" if one_host else name}
                for name in names
            },
            "connections": [
                f"{a}.given -> {b}.taken" for a, b in zip(names, [*names[1:], names[0]], strict=True)
            ],
        }
    )
    plan, made = plan_of(scenario, dict.fromkeys(names, Params()))
    here = made if one_host else {}
    return steps / Session(scenario, plan, here, Path.cwd(), endpoint="tcp/127.0.0.1:0").run().wall_time_s


def bare(participants: int, window: int, steps: int) -> float:
    """Return the steps per second of a bare star (window 1) or ring."""
    port = LoopbackPort("tcp/127.0.0.1:0")
    endpoint = port.endpoint
    with port.listen() as hub:
        ready = hub.declare_subscriber("bare/ready/*", FifoChannel(64))
        results = (
            hub.declare_subscriber("bare/*/out", FifoChannel(4096))
            if window == 1
            else hub.declare_subscriber("bare/done", FifoChannel(8))
        )
        grant = hub.declare_publisher("bare/grant", **QOS)
        command = [
            sys.executable,
            "-P",
            __file__,
            "--worker",
            endpoint,
            "--participants",
            str(participants),
            "--window",
            str(window),
            "--steps",
            str(steps),
        ]
        workers = [subprocess.Popen([*command, "--index", str(i)]) for i in range(participants)]
        try:
            seen: set[bytes] = set()
            while len(seen) < participants:
                seen.add(ready.recv().payload.to_bytes())
            begun = perf_counter()
            if window > 1:
                grant.put(PAYLOAD)
                return struct.unpack("<d", results.recv().payload.to_bytes())[0]
            for step in range(steps):
                grant.put(HEAD.pack(step, 0) + PAYLOAD)
                for _ in range(participants):
                    results.recv()
            return steps / (perf_counter() - begun)
        finally:
            for worker in workers:
                worker.kill()
                worker.wait()


def worker(endpoint: str, index: int, participants: int, window: int, steps: int) -> None:
    """Be one process of a bare exchange."""
    with open_session("peer", listen=["tcp/127.0.0.1:0"], connect=[endpoint]) as session:
        out = session.declare_publisher(f"bare/{index}/out", **QOS)
        grants = session.declare_subscriber("bare/grant", FifoChannel(64))
        neighbour = (
            session.declare_subscriber(f"bare/{(index - 1) % participants}/out", FifoChannel(4096))
            if window > 1
            else None
        )
        _wait_for_start(session, out, grants, neighbour, index)
        if neighbour is None:
            for step in range(steps):
                out.put(HEAD.pack(step, index) + PAYLOAD)
                grants.recv()
            return
        begun = perf_counter()
        for step in range(steps):
            out.put(HEAD.pack(step, index) + PAYLOAD)
            while HEAD.unpack_from(neighbour.recv().payload.to_bytes())[0] != step:
                pass  # what was sent before the start
        if index == 0:
            session.put(
                "bare/done",
                struct.pack("<d", steps / (perf_counter() - begun)),
                congestion_control=zenoh.CongestionControl.BLOCK,
            )
        grants.recv()


def _wait_for_start(
    session: zenoh.Session,
    out: zenoh.Publisher,
    grants: zenoh.Subscriber,
    neighbour: zenoh.Subscriber | None,
    index: int,
) -> None:
    """Report ready once values of the neighbour arrive, until the first grant: then all are."""
    heard = neighbour is None
    while grants.try_recv() is None:
        if neighbour is not None:
            out.put(HEAD.pack(2**63, index) + PAYLOAD)
            heard = heard or neighbour.try_recv() is not None
        if heard:
            session.put("bare/ready/x", str(index).encode())
        sleep(0.01)


def plain_loop(participants: int, steps: int) -> float:
    """Return the steps per second of calling the participants in a plain loop."""
    from lockstep_participant import Exchange

    from hub.participant import Inputs, Setup

    made = [Exchange(str(i), Params()) for i in range(participants)]
    values = [dict(p.configure(Setup(period_ns=10**6, directory=Path()))) for p in made]
    taken = [{"taken": v["given"]} for v in values]
    inputs = [Inputs(its) for its in taken]
    begun = perf_counter()
    for step in range(steps):
        for i, participant in enumerate(made):
            taken[i]["taken"] = values[i - 1]["given"]
            values[i] = participant.step(step * 10**6, 10**6, inputs[i])
    return steps / (perf_counter() - begun)


def main() -> None:
    """Alternate both systems and report the medians and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--participants", type=int, default=2)
    parser.add_argument("--window", type=int, default=1)
    parser.add_argument("--steps", type=int, default=3000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--one-host", action="store_true")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--output", type=Path)
    parser.add_argument("--worker", help=argparse.SUPPRESS)
    parser.add_argument("--index", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.worker:
        worker(args.worker, args.index, args.participants, args.window, args.steps)
        return
    here = str(Path(__file__).parent)
    sys.path.insert(0, here)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH")]))
    rows: list[tuple[float, float]] = []
    for _ in range(args.rounds):
        ours = trocar(args.participants, args.window, args.steps, one_host=args.one_host)
        other = (
            plain_loop(args.participants, args.steps)
            if args.one_host
            else bare(args.participants, args.window, args.steps)
        )
        rows.append((ours, other))
    ours, other = (statistics.median(column) for column in zip(*rows, strict=True))
    result = {
        "participants": args.participants,
        "window": args.window,
        "one_host": args.one_host,
        "steps_per_s": round(ours),
        "bare_steps_per_s": round(other),
        "ratio": round(statistics.median(a / b for a, b in rows), 3),
        "own_us_per_step": round(1e6 / ours - 1e6 / other, 2),
        "rounds": [[round(a), round(b)] for a, b in rows],
    }
    text = json.dumps(result) if args.json else "\n".join(f"{key}: {value}" for key, value in result.items())
    if args.output:
        args.output.write_text(json.dumps(result, indent=2) + "\n")
    print(text)


if __name__ == "__main__":
    main()
