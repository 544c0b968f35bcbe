"""Policies behind a ZeroMQ server of GR00T: one request, one answer.

Observation `{"video": {key: (1, 1, H, W, 3)}, "state": {key: (1, 1, n)}, "language": {key: [[text]]}}`;
answer `{key: (1, horizon, n)}`, or that and a dictionary of information. Keys are the groups of the contract.
Source: NVIDIA/Isaac-GR00T N1.7, gr00t/policy/server_client.py and getting_started/policy.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from threading import RLock
from time import monotonic
from typing import Any, cast
from urllib.parse import urlsplit

import numpy as np

from devices.policies.array_messages import MOST_BYTES, check_package, pack_groot, unpack
from devices.policies.policy import Observation, check_actions
from robots.policies.fields import Group
from robots.policies.terms import Terms
from schemas.errors import DeviceError, MessageError, ScenarioError
from schemas.vectors import Vector

__all__ = ["GrootPolicy"]


_POLL_MS = 50
"""Longest wait until a question is given up, ms."""


class GrootPolicy:
    """A socket to a server. After a DeviceError it is closed; open another."""

    def __init__(self, backend: str, terms: Terms, timeout_s: float) -> None:
        """Ask for the modalities, and compare them with the contract; raises as `open_policy`."""
        check_package(backend, "msgpack", "zmq")
        import zmq

        self._backend, self._terms, self._timeout_s = backend, terms, timeout_s
        self._videos = {name: camera.key or name.replace("/", "_") for name, camera in terms.cameras.items()}
        address = urlsplit(backend)
        self._using, self._closing = RLock(), False
        self._socket: Any = cast("Any", zmq.Context.instance()).socket(zmq.REQ)
        for option, value in (
            (zmq.LINGER, 0),
            (zmq.IPV6, int(":" in (address.hostname or ""))),
            (zmq.SNDTIMEO, round(1e3 * timeout_s)),
            (zmq.MAXMSGSIZE, MOST_BYTES),
        ):
            self._socket.setsockopt(option, value)
        try:
            self._socket.connect(f"tcp://{address.netloc}")
            self._metadata = self._modalities()
            self._task_key = next(iter(self._metadata.get("language", {}).get("keys", ())), "task")
            if misfits := list(self._misfits()):
                raise ScenarioError(
                    f"policy '{backend}' does not fit the contract: {'; '.join(misfits)}",
                    path=("scene", "contract"),
                )
        except BaseException:
            self.close()
            raise

    @property
    def metadata(self) -> Mapping[str, Any]:
        """Keys and number of instants by modality, as far as the server states them."""
        return self._metadata

    def reset(self, episode: int) -> None:
        """Begin an episode."""
        self._request("reset", {"options": {"episode": episode}})

    def act(self, observation: Observation) -> Vector:
        """Return the rows of actions."""
        tree: dict[str, Any] = {
            "video": {self._videos[name]: image[None, None] for name, image in observation.images.items()},
            "state": self._state(observation.state.astype(np.float32)),
            "language": {self._task_key: [[observation.instruction]]},
        }
        answer = self._request("get_action", {"observation": {**tree, **observation.extra}, "options": None})
        if isinstance(answer, list):  # actions and information
            answer = next(iter(cast("list[Any]", answer)), None)
        return check_actions(self._rows(answer), self._terms)

    def _state(self, state: Any) -> dict[str, Any]:
        ends = np.cumsum([len(group.fields) for group in self._terms.state_groups]).tolist()
        return {
            group.name: state[None, None, end - len(group.fields) : end]
            for group, end in zip(self._terms.state_groups, ends, strict=True)
        }

    def _rows(self, answer: object) -> Any:
        """Return the groups of an answer side by side, in the contract's order."""
        if not isinstance(answer, dict):
            raise MessageError(
                f"policy '{self._backend}' answers with {answer!r:.100}, expected actions by key"
            )
        actions = {str(key).removeprefix("action."): value for key, value in cast("Any", answer).items()}
        parts: list[Any] = []
        for group in self._terms.action_groups:
            part = actions.get(group.name)
            if not isinstance(part, np.ndarray) or part.ndim not in (2, 3):
                raise MessageError(
                    f"policy '{self._backend}' answers without '{group.name}' of shape (1, horizon,"
                    f" {len(group.fields)}); it has {_describe(actions)}"
                )
            rows = cast("Any", part[0] if part.ndim == 3 else part)
            if rows.shape[1] != len(group.fields) or (parts and len(rows) != len(parts[0])):
                raise MessageError(
                    f"policy '{self._backend}' answers '{group.name}' with {len(rows)} rows of"
                    f" {rows.shape[1]}, expected rows of {len(group.fields)}, as many in each group"
                )
            parts.append(rows)
        return np.concatenate(parts, axis=1)

    def _modalities(self) -> dict[str, dict[str, Any]]:
        """Return keys and number of instants of each modality; empty if the server states none."""
        try:
            answer = self._request("get_modality_config", None)
        except MessageError:  # a server without this question
            return {}
        found: dict[str, dict[str, Any]] = {}
        for name, stated in cast("dict[Any, Any]", answer).items() if isinstance(answer, dict) else ():
            outer = cast("dict[str, Any]", stated) if isinstance(stated, dict) else {}
            inner: Any = outer.get("as_json", outer)
            config = cast("dict[str, Any]", inner) if isinstance(inner, dict) else {}
            keys = [str(key).removeprefix(f"{name}.") for key in config.get("modality_keys") or ()]
            found[str(name)] = {"keys": keys, "instants": len(config.get("delta_indices") or ())}
        return found

    def _misfits(self) -> Iterator[str]:
        videos = list(self._videos.values())
        states, actions = _names(self._terms.state_groups), _names(self._terms.action_groups)
        for name, ours in (("video", videos), ("state", states), ("action", actions)):
            stated = self._metadata.get(name)
            if stated is None:
                continue
            if missing := [key for key in stated["keys"] if key not in ours]:
                known = ", ".join(ours) or "nothing"
                yield f"{name}: the policy has {', '.join(missing)}, the contract {known}"
            if name == "action" and (absent := [key for key in ours if key not in stated["keys"]]):
                yield f"action: the contract has {', '.join(absent)}, the policy not"
            if name != "action" and stated["instants"] > 1:
                yield f"{name}: the policy wants {stated['instants']} instants, a session sends one"
            if name == "action" and stated["instants"] > self._terms.horizon:
                yield f"horizon: the policy has {stated['instants']} rows, the contract {self._terms.horizon}"

    def _request(self, endpoint: str, data: Any) -> Any:
        import zmq

        request: dict[str, Any] = {"endpoint": endpoint}
        if data is not None:
            request["data"] = data
        with self._using:
            if self._socket is None:
                raise DeviceError(f"policy '{self._backend}' is closed")
            try:
                self._socket.send(pack_groot(request))
                message = self._receive()
            except zmq.ZMQError as error:
                self.close()
                raise DeviceError(f"policy '{self._backend}' cannot be asked: {error}") from error
            if message is None:
                self.close()  # an answer that comes later is to an old question
                raise DeviceError(
                    f"policy '{self._backend}' has not answered '{endpoint}' within {self._timeout_s:g} s"
                )
        answer: Any = unpack(message)
        if isinstance(answer, dict) and "error" in answer:
            reason = cast("dict[str, Any]", answer)["error"]
            raise MessageError(f"policy '{self._backend}' reports an error: {reason!s:.300}")
        return cast("Any", answer)

    def _receive(self) -> bytes | None:
        """Return the answer; None after the longest wait, or once the policy is to be closed."""
        deadline = monotonic() + self._timeout_s
        while not self._socket.poll(_POLL_MS):
            if self._closing or monotonic() > deadline:
                return None
        return self._socket.recv()

    def close(self) -> None:
        """Disconnect; a question on its way is given up."""
        self._closing = True
        with self._using:  # a socket belongs to one thread at a time
            socket, self._socket = self._socket, None
            if socket is not None:
                socket.close()


def _names(groups: tuple[Group, ...]) -> list[str]:
    return [group.name for group in groups]


def _describe(actions: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{key} {getattr(value, 'shape', type(value).__name__)}" for key, value in actions.items()
    )
