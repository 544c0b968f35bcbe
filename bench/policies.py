"""Time from observation to command with a policy behind a local openpi server, and two pictures.

    python -m bench.policies                     # 20 s
    python -m bench.policies --seconds 60 --output policies.json

The server, a process of its own, answers at once, so all is overhead: packing two pictures of 224 x 224,
websocket, checks, entering. *Backend*: `Policy.act` in a loop. *Session*: the scenario `policy` at the pace
of the wall clock, from the readings that are sent to the end of the step that commands the answer's rows,
in simulated time, which is then wall time. Of these figures two steps, 2 ms, are the session's own: the step
that reads and the step that commands.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import trocar
from devices.policies.array_messages import pack_openpi, unpack
from devices.policies.params import PolicyParams
from trocar.policies import Observation, open_policy

SIDE = 224
CAMERAS = {f"endoscope/{eye}": {"width": SIDE, "height": SIDE} for eye in ("left", "right")}
HORIZON = 15
_ASKED = {"p50": 3.0, "p99": 10.0}
"""Overhead to reach, ms."""


def serve() -> None:
    """Serve a policy that stays where it is, and print the port."""
    from websockets.sync.server import ServerConnection
    from websockets.sync.server import serve as serve_websocket

    def handle(connection: ServerConnection) -> None:
        connection.send(pack_openpi({}))
        for message in connection:
            state = unpack(bytes(message, "utf-8") if isinstance(message, str) else message)[
                "observation/state"
            ]
            connection.send(pack_openpi({"actions": np.tile(state, (HORIZON, 1))}))

    with serve_websocket(handle, "127.0.0.1", 0, compression=None, max_size=None) as server:
        print(server.socket.getsockname()[1], flush=True)
        server.serve_forever()


def time_backend(address: str, count: int) -> list[float]:
    """Return the round trips of `Policy.act`, ms."""
    contract = {"horizon": HORIZON, "cameras": CAMERAS}
    given = {"arms": {"PSM1": {"instrument": "400006"}}, "backend": address, "contract": contract}
    policy = open_policy(address, PolicyParams.model_validate(given).terms)
    picture = np.random.default_rng(0).integers(0, 255, (SIDE, SIDE, 3), np.uint8)
    state = np.array([0.0, 0.0, -0.12, 0.0, 0.0, 0.0, 1.0, 0.0], np.float32)
    times: list[float] = []
    for number in range(1, count + 1):
        start = perf_counter()
        policy.act(Observation(number, dict.fromkeys(CAMERAS, picture), state, "stay"))
        times.append(1e3 * (perf_counter() - start))
    policy.close()
    return times[count // 10 :]


def time_session(address: str, seconds: float) -> tuple[list[float], Mapping[str, Any]]:
    """Return the times from observation to command, ms, and facts of the session."""
    camera = {"kind": "endoscope", "host": "camera", "period": "40 ms", "width": SIDE, "height": SIDE}
    values = {
        "pace": "realtime",
        "duration": f"{seconds:g} s",
        "participants.policy.backend": address,
        "participants.policy.time": "wall",
        "participants.camera": camera,
        "scene.contract.cameras": CAMERAS,
    }
    with tempfile.TemporaryDirectory() as directory:
        summary = trocar.run(str(_scenario(Path(directory))), set=values, record=f"{directory}/recording")
        recording = trocar.Recording(f"{directory}/recording")
        entered = [(t, chunk) for t, chunk in recording["policy.actions"].messages()]
        asked = [t for t, _ in recording["governor.observation"].messages()]
        late = summary.measures.get("late")
    times = [
        1e3 * (t - chunk.header.stamp.ns * 1e-9) + 1.0  # commanded at the end of the step
        for t, chunk in entered
        if not chunk.fault
    ]
    return times[5:], {"answers": len(entered), "observations": len(asked), "late": late}


def _scenario(directory: Path) -> Path:
    """Write the scenario `policy` with connections of a camera."""
    from hub.planning.scenario_file import installed_scenarios

    text = installed_scenarios()["policy"].read_text()
    connections = "connections:\n  - robot.qpos -> camera.qpos\n  - camera.* -> policy.endoscope/*\n"
    (directory / "policy.yaml").write_text(text.replace("connections:\n", connections, 1))
    return directory / "policy.yaml"


def percentiles(times: ArrayLike) -> dict[str, float]:
    """Return median, 99th percentile and maximum."""
    p50, p99, most = np.percentile(np.asarray(times), [50, 99, 100]).tolist()
    return {"p50": p50, "p99": p99, "most": most}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="overhead of a policy behind an openpi server")
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--seconds", type=float, default=20.0, help="of the session")
    parser.add_argument("--count", type=int, default=1000, help="round trips of the backend alone")
    parser.add_argument("--output", type=Path, help="file for the figures, JSON")
    words = parser.parse_args()
    if words.serve:
        serve()
        return
    command = [sys.executable, "-P", "-m", "bench.policies", "--serve"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[1]
    ) as server:
        try:
            assert server.stdout
            address = f"openpi://127.0.0.1:{server.stdout.readline().strip()}"
            backend = percentiles(time_backend(address, words.count))
            times, facts = time_session(address, words.seconds)
        finally:
            server.kill()
    session = percentiles(times)
    print(f"{'ms':10}{'p50':>8}{'p99':>8}{'most':>8}")
    for name, row in (("asked", _ASKED), ("backend", backend), ("session", session)):
        print(f"{name:10}" + "".join(f"{value:8.2f}" for value in row.values()))
    print(facts)
    if words.output:
        words.output.write_text(json.dumps({"backend": backend, "session": session, **facts}, indent=1))


if __name__ == "__main__":
    main()
