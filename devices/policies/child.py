"""A policy in a child process: of Python, an ONNX model or a checkpoint, with an interpreter of its own."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import threading
from collections.abc import Mapping
from pathlib import Path
from queue import Empty, SimpleQueue
from time import monotonic
from typing import Any, BinaryIO, cast

from devices.policies import worker
from devices.policies.policy import Observation, check_actions
from devices.policies.statement import check_statement
from robots.policies.terms import Terms
from schemas.errors import DeviceError, MessageError
from schemas.vectors import Vector

__all__ = ["ChildPolicy"]

_END_S = 2.0
"""Time to end by itself."""


class ChildPolicy:
    """A process that answers questions in order; started again after it has died."""

    def __init__(
        self, backend: str, terms: Terms, timeout_s: float, directory: Path, python: str = ""
    ) -> None:
        """Start the process. Raises DeviceError and ScenarioError as `open_policy`."""
        self._backend, self._terms, self._timeout_s = backend, terms, timeout_s
        self._number = 0
        self._answers: SimpleQueue[Any] = SimpleQueue()
        try:
            self._process = subprocess.Popen(
                [python or sys.executable, str(Path(worker.__file__).resolve())],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                cwd=directory,
            )
        except OSError as error:
            raise DeviceError(f"policy '{backend}' cannot be started: {error}") from error
        self._reader = threading.Thread(target=self._read_answers, name="policy", daemon=True)
        self._reader.start()
        try:
            self._send({"backend": backend, "directory": str(directory), "contract": terms.describe()})
            said = self._receive(timeout_s)
            if "error" in said:
                raise DeviceError(f"policy '{backend}' cannot be started: {said['error']}")
            self._metadata = cast("Mapping[str, Any]", said.get("metadata") or {})
            check_statement(backend, self._metadata, terms)
        except BaseException:
            self.close()
            raise

    @property
    def metadata(self) -> Mapping[str, Any]:
        """The attribute `metadata` of the policy."""
        return self._metadata

    def reset(self, episode: int) -> None:
        """Begin an episode."""
        self._ask({"episode": episode})

    def act(self, observation: Observation) -> Vector:
        """Return the rows of actions."""
        tree = {
            "images": dict(observation.images),
            "state": observation.state,
            "prompt": observation.instruction,
            "time": observation.time_s,
            "number": observation.number,
            **observation.extra,
        }
        return check_actions(self._ask({"observation": tree}).get("actions"), self._terms)

    def _ask(self, question: dict[str, Any]) -> Mapping[str, Any]:
        self._number += 1
        self._send({"number": self._number, **question})
        deadline = monotonic() + self._timeout_s
        while True:
            answer = self._receive(deadline - monotonic())
            number = answer.get("number")
            if number == self._number:
                break
            if not isinstance(number, int) or number > self._number:
                raise MessageError(
                    f"policy '{self._backend}' answers question {number!r}, not {self._number}"
                )
        if "error" in answer:
            raise DeviceError(f"policy '{self._backend}' has failed: {answer['error']}")
        return answer

    def _send(self, tree: Mapping[str, Any]) -> None:
        try:
            worker.write_frame(cast("BinaryIO", self._process.stdin), tree)
        except (OSError, ValueError) as error:
            raise DeviceError(f"policy '{self._backend}' has ended{self._exit()}: {error}") from error

    def _receive(self, timeout_s: float) -> Mapping[str, Any]:
        try:
            answer = self._answers.get(timeout=max(timeout_s, 0.0))
        except Empty:
            raise DeviceError(
                f"policy '{self._backend}' has not answered within {self._timeout_s:g} s"
            ) from None
        if isinstance(answer, EOFError):
            self._answers.put(answer)
            raise DeviceError(f"policy '{self._backend}' has ended{self._exit()}") from answer
        if isinstance(answer, Exception):
            raise MessageError(f"policy '{self._backend}' answers in no known form: {answer}") from answer
        if not isinstance(answer, dict):
            raise MessageError(f"policy '{self._backend}' answers in no known form: {type(answer).__name__}")
        return cast("dict[str, Any]", answer)

    def _exit(self) -> str:
        """Return the exit code of the process in words, once it has ended."""
        try:
            return f" with exit code {self._process.wait(timeout=0.5)}"
        except subprocess.TimeoutExpired:
            return ""

    def _read_answers(self) -> None:
        with cast("BinaryIO", self._process.stdout) as file:
            while True:
                try:
                    self._answers.put(worker.read_frame(file))
                except (EOFError, OSError) as error:
                    self._answers.put(EOFError(str(error)))
                    return
                except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
                    self._answers.put(error)
                    return

    def close(self) -> None:
        """End the process."""
        if self._process.stdin is not None and not self._process.stdin.closed:
            with contextlib.suppress(OSError):  # it has ended with a question on its way
                self._process.stdin.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()
