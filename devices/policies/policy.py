"""The protocol of a policy's backend: observation in, rows of actions out.

    policy = open_policy("openpi://localhost:8000", terms, timeout_s=10.0)
    policy.reset(0)
    rows = policy.act(observation)     # (rows, width), as the contract states

A session's device and a loop without a session use the same backends.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Protocol, cast
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from robots.policies.terms import Terms
from schemas.errors import DeviceError, MessageError, did_you_mean
from schemas.vectors import Vector

__all__ = ["BACKENDS", "Observation", "Policy", "check_actions", "check_backend", "open_policy"]

log = logging.getLogger(__name__)

BACKENDS = {
    "openpi": "openpi://HOST:PORT, a websocket server of openpi",
    "groot": "groot://HOST:PORT, a ZeroMQ server of GR00T",
    "i4h": (
        "i4h:ENVIRONMENT@HOST:PORT or i4h:ENVIRONMENT@multicast, a process of Isaac for Healthcare (Zenoh)"
    ),
    "onnx": "onnx:FILE.onnx, a model in a process of its own",
    "lerobot": "lerobot:DIRECTORY, a checkpoint of LeRobot in a process of its own",
    "python": "python:FILE.py:NAME or python:MODULE:NAME, a function or a class in a process of its own",
}
"""Prefixes of a backend's address, and the form of each."""
_NETWORK_BACKENDS = ("openpi", "groot", "i4h")


@dataclass(frozen=True)
class Observation:
    """The question to a policy."""

    number: int
    """Number of the observation in the session, from 1."""
    images: Mapping[str, NDArray[np.uint8]]
    """RGB pictures, shape (height, width, 3), by the contract's name of the camera."""
    state: NDArray[np.float32]
    """State in the layout of the contract."""
    instruction: str = ""
    """The task in words."""
    time_s: float = 0.0
    """Simulated time, s."""
    extra: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Further arrays and texts by the policy's own keys."""


class Policy(Protocol):
    """A policy that can be asked; all methods raise errors of `TrocarError`."""

    @property
    def metadata(self) -> Mapping[str, Any]:
        """What the policy says of itself; the entry `contract`, where stated, is checked."""
        ...

    def reset(self, episode: int) -> None:
        """Begin an episode."""
        ...

    def act(self, observation: Observation) -> Vector:
        """Return the rows of actions, shape (rows, width)."""
        ...

    def close(self) -> None:
        """Release the policy; may be called twice."""
        ...


def check_backend(backend: str) -> str:
    """Return the address of a backend; raises ValueError for an unknown form."""
    prefix = backend.partition(":")[0]
    if prefix not in BACKENDS:
        known = "; ".join(BACKENDS.values())
        raise ValueError(f"'{backend}' names no backend.{did_you_mean(prefix, BACKENDS)} Backends: {known}")
    rest = backend.removeprefix(f"{prefix}:")
    is_complete = {
        "openpi": _is_address(backend),
        "groot": _is_address(backend),
        "python": all(rest.rpartition(":")[::2]),
        "i4h": re.fullmatch(r"[A-Za-z0-9_-]+@(multicast|[^/*$?#@]+:[0-9]+)", rest) is not None,
    }
    if not is_complete.get(prefix, bool(rest)):
        raise ValueError(f"'{backend}' is incomplete, expected {BACKENDS[prefix]}")
    return backend


def _is_address(backend: str) -> bool:
    try:
        parts = urlsplit(backend)
        return bool(parts.hostname and parts.port)
    except ValueError:  # a port that is no number
        return False


def open_policy(
    backend: str,
    terms: Terms,
    *,
    timeout_s: float = 10.0,
    directory: Path | None = None,
    python: str = "",
) -> Policy:
    """Return the policy behind an address, ready to be asked.

    Args:
        backend: Address, one of the forms in `BACKENDS`.
        terms: The contract with all names.
        timeout_s: Longest wait for the start, and for each answer.
        directory: Where relative paths of files and modules start; default: the working directory.
        python: Interpreter of a policy in a process of its own; default: this one.

    Raises DeviceError if the policy cannot be reached or started, MissingExtraError, and ScenarioError if
    policy and contract do not fit.
    """
    try:
        check_backend(backend)
    except ValueError as error:
        raise DeviceError(str(error)) from error
    _warn_of_clear_text(backend)
    prefix = backend.partition(":")[0]
    if prefix == "openpi":
        from devices.policies.openpi import OpenPiPolicy

        return OpenPiPolicy(backend, terms, timeout_s)
    if prefix == "groot":
        from devices.policies.groot import GrootPolicy

        return GrootPolicy(backend, terms, timeout_s)
    if prefix == "i4h":
        from devices.policies.i4h import I4hPolicy

        return I4hPolicy(backend, terms, timeout_s)
    from devices.policies.child import ChildPolicy

    return ChildPolicy(backend, terms, timeout_s, directory or Path.cwd(), python)


def _warn_of_clear_text(backend: str) -> None:
    """Log a warning for a policy on another machine: none of the protocols encrypts."""
    prefix, _, rest = backend.partition(":")
    if prefix not in _NETWORK_BACKENDS:
        return
    host = urlsplit(f"//{rest.rpartition('@')[2]}" if prefix == "i4h" else backend).hostname or ""
    if not _is_loopback(host):
        log.warning(
            "policy '%s' is reached in the clear: others in the network can read pictures and send commands;"
            " lead a tunnel there (ssh -L), and state its end on this machine",
            backend,
        )


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:  # a name
        return False


def check_actions(answer: object, terms: Terms) -> Vector:
    """Return an answer as rows, shape (rows, width).

    Raises MessageError for another shape, for text or objects, and for numbers that are not finite.
    """
    expected = f"the contract has 1 to {terms.horizon} rows of {terms.width} ({terms.action})"
    array = cast("NDArray[Any]", answer) if isinstance(answer, np.ndarray) else None
    if array is None or array.dtype.kind not in "fiu":
        kind = "no array" if array is None else f"an array of {array.dtype}"
        raise MessageError(f"the answer is {kind}, expected an array of numbers: {expected}")
    rows: NDArray[Any] = array[None] if array.ndim == 1 else array
    if rows.ndim == 3 and len(rows) == 1:  # a batch of one
        rows = rows[0]
    if rows.ndim != 2 or rows.shape[1] != terms.width or not 1 <= len(rows) <= terms.horizon:
        raise MessageError(f"the answer has shape {array.shape}: {expected}")
    with np.errstate(over="ignore", invalid="ignore"):
        numbers = rows.astype(np.float64)
    if not np.isfinite(numbers).all():
        row, column = (int(i) for i in np.argwhere(~np.isfinite(numbers))[0])
        name = terms.action_fields[column].name
        raise MessageError(f"the answer has {numbers[row, column]} at row {row}, '{name}': not finite")
    return numbers
