"""A scene that another process draws, so that the session outlives a renderer that aborts."""

from __future__ import annotations

import atexit
import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import asdict
from tempfile import TemporaryFile
from typing import Any, BinaryIO, cast

import numpy as np
from numpy.typing import NDArray

from engines.mujoco.pictures.drawing_frames import read_frame, write_frame
from engines.mujoco.pictures.endoscope_params import EndoscopeParams
from engines.mujoco.pictures.filament.backend import Backend
from engines.mujoco.pictures.seen_state import SeenState
from schemas.errors import TrocarError
from schemas.vectors import Vector

__all__ = ["DrawingLostError", "SceneApart"]

_PROCESS = "engines.mujoco.pictures.drawing_process"
_END_S = 10.0
"""Time to end by itself."""
_LONGEST = 300
"""Characters of what a driver says last."""


class DrawingLostError(TrocarError):
    """The process that draws has ended; the text is the end of a sentence about its end."""


class SceneApart:
    """The scene of one camera, in a process of its own."""

    def __init__(self, params: EndoscopeParams, backend: Backend, state: SeenState) -> None:
        """Begin to prepare. Raises DrawingLostError.

        Args:
            params: of the cameras.
            backend: the graphics interface to use.
            state: what is drawn, by now with what each soft body may bring.
        """
        self._shape = params.height, params.width, 3
        self._state = state
        self._process: _Process | None = _take_idle() or _Process()
        opening = {
            "params": json.loads(params.model_dump_json(exclude_unset=True)),
            "backend": asdict(backend),
            "bodies": {organ: [one.may_change, one.may_be_wet] for organ, one in state.bodies.items()},
        }
        self.lens: Vector = np.zeros(3)
        """Place midway between the cameras at the state drawn last, shape (3,), m, in the world."""
        self._process.send(opening, asks=not state.bodies)

    def wait(self) -> None:
        """Wait until all is prepared but for soft bodies, whose shapes come with the first state.

        Raises DrawingLostError.
        """
        if self._process is not None and not self._state.bodies:
            self._process.receive()

    @property
    def pid(self) -> int:
        """Number of the process that draws; 0 after the end."""
        return 0 if self._process is None else self._process.pid

    def draw(self, time_ns: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """Return both pictures of the state, shape (height, width, 3), RGB. Raises DrawingLostError."""
        if self._process is None:
            raise DrawingLostError("has been closed")
        self._process.send({"time_ns": time_ns}, self._state.save(), asks=True)
        header, pixels = self._process.receive()
        self.lens = np.array(header["lens"])
        left, right = np.frombuffer(pixels, np.uint8).reshape(2, *self._shape)
        return left, right

    def close(self) -> None:
        """Leave the process to the next scene. May be called twice."""
        if self._process is not None:
            _leave_idle(self._process)
            self._process = None


class _Process:
    """A process that draws, started at once and heard later."""

    def __init__(self) -> None:
        self._errors = TemporaryFile()  # noqa: SIM115  # closed with the process
        self._owes = False
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", _PROCESS],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
        )

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def is_free(self) -> bool:
        """Whether it runs and owes no answer."""
        return self._process.poll() is None and not self._owes

    def send(self, header: dict[str, Any], payload: bytes = b"", *, asks: bool) -> None:
        self._owes = asks
        try:
            write_frame(cast("BinaryIO", self._process.stdin), header, payload)
        except OSError as error:
            raise DrawingLostError(self._end()) from error

    def receive(self) -> tuple[dict[str, Any], bytes]:
        try:
            answer = read_frame(cast("BinaryIO", self._process.stdout))
        except (EOFError, OSError) as error:
            raise DrawingLostError(self._end()) from error
        self._owes = False
        return answer

    def _end(self) -> str:
        """Return how the process has ended."""
        code, said = self.close()
        how = f"was killed by {signal.Signals(-code).name}" if code < 0 else f"ended with {code}"
        return f"{how} ({said})" if said else how

    def close(self) -> tuple[int, str]:
        """End the process; return its exit code, and what it said last."""
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):  # a question may be on its way
                cast("BinaryIO", pipe).close()
        try:
            code = self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        with self._errors as said:
            said.seek(0)
            lines = said.read().decode(errors="replace").strip().splitlines()
        return code, lines[-1][:_LONGEST] if lines else ""


_idle: dict[int, _Process] = {}
"""At most one process that waits for a scene, by the process that started it: a fork has none."""


def _take_idle() -> _Process | None:
    """Return the process that waits, if it has not ended meanwhile."""
    process = _idle.pop(os.getpid(), None)
    if process is None or process.is_free:
        return process
    process.close()
    return None


def _leave_idle(process: _Process) -> None:
    if os.getpid() in _idle or not process.is_free:
        process.close()
        return
    with suppress(DrawingLostError):
        process.send({}, asks=False)  # frees the scene
        _idle[os.getpid()] = process


@atexit.register
def _end_idle() -> None:
    if (process := _idle.pop(os.getpid(), None)) is not None:
        process.close()
