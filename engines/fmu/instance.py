"""One instance of an FMU: what FMI 2.0 and 3.0 have in common."""

from __future__ import annotations

import contextlib
import ctypes
import logging
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from engines.fmu.blocks import WARNING, Block, grouped, prepared
from engines.fmu.description import Description
from engines.fmu.log import last_warning
from engines.fmu.start import Start
from hub.participant import Inputs
from schemas.errors import ScenarioError, SessionError

__all__ = ["DISCARD", "Instance"]

_log = logging.getLogger(__name__)
_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
DISCARD, _ERROR, _FATAL = 2, 3, 4
"""FMI statuses (fmi2Status, fmi3Status)."""


def _load(slave: type[Any], description: Description, directory: Path, name: str) -> Any:
    """Load the FMU that was extracted to `directory` through FMPy's class `slave`.

    Raises ScenarioError if its library cannot be loaded.
    """
    identifier = description.co_simulation.modelIdentifier
    try:
        # FMPy changes the directory to load, and leaves it changed when that fails
        with contextlib.chdir(Path.cwd()):
            return slave(
                guid=description.guid,
                modelIdentifier=identifier,
                unzipDirectory=str(directory),
                instanceName=name,
            )
    except (
        Exception
    ) as error:  # FMPy raises a bare Exception or, for a function that is missing, AttributeError
        raise ScenarioError(f"the library of '{description.path}' cannot be loaded: {error}") from error


class Instance(ABC):
    """A loaded FMU.

    Raises SessionError, with the FMU's own message, whenever one of its functions fails.
    """

    prefix: ClassVar[str]
    """`fmi2` or `fmi3`."""
    counted: ClassVar[bool]
    """The set and get functions take the number of values."""
    state_word: ClassVar[str]
    deserialise_word: ClassVar[str]
    byte: ClassVar[Any]
    """C type of a serialised state's elements."""

    def __init__(
        self, slave: type[Any], description: Description, name: str, options: Mapping[str, Any]
    ) -> None:
        """Extract and load the FMU through FMPy's class `slave` and instantiate it with `options`.

        Raises ScenarioError if the library cannot be loaded, SessionError if the FMU refuses to be
        instantiated.
        """
        from fmpy import extract

        self._name = name
        with contextlib.ExitStack() as stack:
            directory = stack.enter_context(tempfile.TemporaryDirectory(prefix="trocar-fmu-"))
            extract(description.path, directory)
            self._fmu = _load(slave, description, Path(directory), name)
            stack.callback(self._fmu.freeLibrary)
            try:
                self._fmu.instantiate(**options)
            except Exception as error:  # FMPy raises a bare Exception
                raise SessionError(f"'{description.path}' cannot be instantiated{self._reason()}") from error
            self._loaded = stack.pop_all()
        self.can_save = (
            description.co_simulation.canGetAndSetFMUstate and description.co_simulation.canSerializeFMUstate
        )
        self._component: int = self._fmu.component
        self._initialised = False
        self._worst = 0
        self._state = ctypes.c_void_p()
        self.memory = np.zeros(0)
        """What is known between steps apart from the FMU's own state; an array to be written into, never
        replaced.
        """
        self._serialised: Any = (self.byte * 0)()
        self.inputs = [Block("Set", group, self._access) for group in grouped(description.inputs)]
        self.outputs = [Block("Get", group, self._access) for group in grouped(description.outputs)]

    def initialise(self, starts: Sequence[Start], tolerance: float | None) -> None:
        """Set the start values and bring the FMU to time 0."""
        self._initialise(starts, tolerance)
        self._initialised = True

    @abstractmethod
    def _initialise(self, starts: Sequence[Start], tolerance: float | None) -> None: ...

    @abstractmethod
    def set_inputs(self, inputs: Inputs, tau: float, dt: float) -> None:
        """Set the inputs for the `dt` seconds that begin `tau` seconds after the start of the step."""

    @abstractmethod
    def advance(self, t: int, h: int) -> None:
        """Bring the FMU from `t` to `t + h`, both in nanoseconds."""

    def read_outputs(self) -> None:
        """Bring the FMU's outputs into the blocks."""
        for block in self.outputs:
            self.transfer(block)
            block.publish()

    def serialise(self) -> bytes:
        """Return the FMU's state."""
        self.call(f"Get{self.state_word}", ctypes.byref(self._state))
        size = ctypes.c_size_t()
        self.call(f"Serialized{self.state_word}Size", self._state, ctypes.byref(size))
        if len(self._serialised) != size.value:
            self._serialised = (self.byte * size.value)()
        self.call(f"Serialize{self.state_word}", self._state, self._serialised, size)
        return bytes(self._serialised)

    def deserialise(self, state: bytes) -> None:
        """Bring the FMU back to a state that `serialise` returned."""
        restored = ctypes.c_void_p()
        self.call(
            f"{self.deserialise_word}{self.state_word}",
            (self.byte * len(state)).from_buffer_copy(state),
            len(state),
            ctypes.byref(restored),
        )
        try:
            self.call(f"Set{self.state_word}", restored)
        finally:
            self.call(f"Free{self.state_word}", ctypes.byref(restored))

    def close(self) -> None:
        """Terminate and free the instance, unload its library and remove what was extracted."""
        with self._loaded:
            if self._worst >= _FATAL:
                return  # no function of the FMU may be called any more (fmi2Fatal, fmi3Fatal)
            if self._state:
                self._function(f"Free{self.state_word}")(self._component, ctypes.byref(self._state))
            if (
                self._initialised
                and self._worst < _ERROR
                and self._function("Terminate")(self._component) > WARNING
            ):
                _log.warning("%s: %sTerminate failed%s", self._name, self.prefix, self._reason())
            self._function("FreeInstance")(self._component)

    def call(self, function: str, *arguments: Any) -> None:
        """Call an FMI function, named without its prefix."""
        status = self._function(function)(self._component, *arguments)
        if status > WARNING:
            raise self.failure(function, status)

    def failure(self, function: str, status: int, about: str = "") -> SessionError:
        """Return the error for a function that failed, and remember how bad it was.

        `about`: what it was called for, as part of the message.
        """
        self._worst = max(self._worst, status)
        label = _STATUS[status] if 0 <= status < len(_STATUS) else str(status)
        return SessionError(f"{self.prefix}{function} returned '{label}'{about}{self._reason()}")

    def _reason(self) -> str:
        message = last_warning(self._name)
        return f"; the FMU reports: {message}" if message else ""

    def _function(self, name: str) -> Callable[..., int]:
        return getattr(self._fmu.dll, self.prefix + name)

    def _access(self, function: str, references: Sequence[int], raw: NDArray[Any]) -> Callable[[], int]:
        return prepared(self._function(function), self._component, references, raw, counted=self.counted)

    def transfer(self, block: Block) -> None:
        """Set or get a block."""
        status = block.call()
        if status > WARNING:
            raise self.failure(
                block.function, status, f" for '{block.refused() if status == DISCARD else block.names}'"
            )

    def _set_start(self, start: Start) -> None:
        if isinstance(start.value, bytes):
            text = (ctypes.c_char_p * 1)(start.value)
            self.call(
                "SetString", (ctypes.c_uint * 1)(start.reference), 1, text, *([1] if self.counted else [])
            )
            return
        status = self._access(f"Set{start.access}", [start.reference], np.ascontiguousarray(start.value))()
        if status > WARNING:
            raise self.failure(f"Set{start.access}", status, f" for the start value of '{start.name}'")
