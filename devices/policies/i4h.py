"""Policy processes of NVIDIA's Isaac for Healthcare, workflow "agentic", over Zenoh.

A session stands in for the workflow's simulation: it publishes `i4h/agentic/<env>/robot/state` and
`.../camera/<name>`, and the policy process publishes `.../robot/command`, each a map in msgpack without a
version. A command has rows of joint positions, `dt` seconds apart, for a run and an episode that it names.
Source: isaac-for-healthcare/i4h-workflows b402f28, workflows/agentic/common/common/messages.py.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from math import isclose
from queue import Empty, Full, Queue
from time import monotonic, time_ns
from typing import Any, cast
from uuid import uuid4

import numpy as np
import zenoh
from numpy.typing import NDArray
from zenoh.handlers import Callback

from devices.policies.array_messages import check_package, pack_openpi, unpack
from devices.policies.policy import Observation, check_actions
from robots.policies.terms import Terms
from schemas.errors import DeviceError, MessageError, ScenarioError
from schemas.vectors import Vector

__all__ = ["I4hPolicy"]

_MOST_BYTES = 2**20
"""Largest command."""
_MOST_COMMANDS = 32
"""Most commands that wait; more are refused."""
_POLL_S = 0.05
"""Longest wait until a question is given up."""


class I4hPolicy:
    """A policy process that finds the session by the environment's name."""

    def __init__(self, backend: str, terms: Terms, timeout_s: float) -> None:
        """Declare the keys; the process may come later. Raises as `open_policy`."""
        check_package(backend, "msgpack")
        self._backend, self._terms, self._timeout_s = backend, terms, timeout_s
        if (terms.contract.state, terms.contract.action) != ("joint", "joint"):
            raise ScenarioError(
                f"policy '{backend}' reads and writes joint positions: the contract needs state and action"
                f" 'joint', it has '{terms.contract.state}' and '{terms.contract.action}'",
                path=("scene", "contract"),
            )
        environment, _, self._endpoint = backend.removeprefix("i4h:").partition("@")
        self._run, self._episode, self._frame = uuid4().hex, 0, 0
        self._commands: Queue[bytes] = Queue(_MOST_COMMANDS)
        self._session = self._open()
        keys = f"i4h/agentic/{environment}"
        self._state = self._session.declare_publisher(f"{keys}/robot/state")
        self._cameras = {
            name: self._session.declare_publisher(f"{keys}/camera/{camera.key or name.replace('/', '_')}")
            for name, camera in terms.cameras.items()
        }
        self._subscriber = self._session.declare_subscriber(
            f"{keys}/robot/command", Callback(self._keep, indirect=True)
        )

    def _open(self) -> zenoh.Session:
        """Open a peer that connects and does not listen: to the endpoint, or by multicast."""
        config = zenoh.Config()
        settings: dict[str, Any] = {
            "listen/endpoints": [],
            "transport/shared_memory/enabled": False,  # its segments outlive a process that is killed
        }
        if self._endpoint != "multicast":
            settings |= {
                "mode": "client",
                "connect/endpoints": [f"tcp/{self._endpoint}"],
                "scouting/multicast/enabled": False,
            }
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            raise DeviceError(f"policy '{self._backend}' cannot be reached: {error}") from error

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Nothing: the processes state nothing of themselves."""
        return {}

    def reset(self, episode: int) -> None:
        """Begin an episode: commands for another are refused from now on."""
        self._episode = episode

    def act(self, observation: Observation) -> Vector:
        """Publish the observation, and return the rows of the next command for this run and episode."""
        self._clear()
        for name, pixels in observation.images.items():
            self._cameras[name].put(pack_openpi(self._camera_message(pixels)))
        self._frame += 1
        self._state.put(pack_openpi(self._state_message(observation)))
        deadline, others = monotonic() + self._timeout_s, ""
        while True:
            try:
                payload = self._commands.get(timeout=_POLL_S)
            except Empty:
                if monotonic() < deadline and not self._session.is_closed():
                    continue
                raise DeviceError(
                    f"policy '{self._backend}' has not answered within {self._timeout_s:g} s{others}"
                ) from None
            command = self._decode(payload)
            run, episode = command.get("run_id"), command.get("episode_index")
            if (run, episode) == (self._run, self._episode):
                return self._rows(command)
            others = (
                f"; it sends commands for run {str(run)[:40]}, episode {str(episode)[:9]}, another session's:"
                f" this is {self._run}, {self._episode}"
            )

    def _state_message(self, observation: Observation) -> dict[str, Any]:
        return {
            "ts": time_ns(),
            "run_id": self._run,
            "episode_index": self._episode,
            "attempt_index": 0,
            "joint_positions": observation.state.astype(float).tolist(),
            "joint_velocities": [],
            "is_running": True,
        }

    def _camera_message(self, pixels: NDArray[np.uint8]) -> dict[str, Any]:
        height, width, _ = pixels.shape
        return {
            "ts": time_ns(),
            "frame_num": self._frame,
            "width": width,
            "height": height,
            "focal_len": 0.0,
            "data": pixels.tobytes(),
        }

    def _keep(self, sample: zenoh.Sample) -> None:
        try:
            self._commands.put_nowait(sample.payload.to_bytes())
        except Full:  # the oldest are read first, and the newest are made for later questions
            return

    def _clear(self) -> None:
        """Forget commands from before the question."""
        while not self._commands.empty():
            self._commands.get_nowait()

    def _decode(self, payload: bytes) -> dict[str, Any]:
        if len(payload) > _MOST_BYTES:
            raise MessageError(
                f"policy '{self._backend}' sends a command of {len(payload)} bytes, at most {_MOST_BYTES}"
            )
        command: Any = unpack(payload)
        if not isinstance(command, dict):
            raise MessageError(f"policy '{self._backend}' sends a command that is no map: {command!r:.100}")
        return cast("dict[str, Any]", command)

    def _rows(self, command: Mapping[str, Any]) -> Vector:
        """Return the rows of a command. Raises MessageError for another distance of rows, or other sizes."""
        horizon, dt = command.get("horizon"), command.get("dt")
        period = 1.0 / self._terms.contract.rate
        if isinstance(dt, float) and dt and not isclose(dt, period, rel_tol=0.01):
            raise MessageError(
                f"policy '{self._backend}' has rows {dt:g} s apart, the contract {period:g} s"
                f" ({self._terms.contract.rate:g} a second)"
            )
        try:
            numbers = np.array(command.get("joint_positions"), np.float64)
            rows = numbers.reshape(horizon, -1) if isinstance(horizon, int) and horizon > 0 else numbers
        except (TypeError, ValueError) as error:
            raise MessageError(f"policy '{self._backend}' sends no joint positions: {error}") from error
        return check_actions(rows, self._terms)

    def close(self) -> None:
        """Leave the network."""
        if not self._session.is_closed():
            self._subscriber.undeclare()
            self._session.close()
