"""An instance of an FMU: the common part of FMI 2.0 and 3.0."""

from __future__ import annotations

import contextlib
import ctypes
import logging
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Literal, NoReturn

import numpy as np
from numpy.typing import NDArray

from engines.fmu.archive import unpack
from engines.fmu.blocks import WARNING, Block, grouped, prepared
from engines.fmu.description import Description
from engines.fmu.library import Library, load_library
from engines.fmu.linear_input import LinearInput
from engines.fmu.log import last_warning
from engines.fmu.model import library_path
from engines.fmu.sources import provide_library
from engines.fmu.start import Start
from engines.fmu.texts import Text, TextInputs, TextOutputs
from engines.fmu.transfers import Stop, Transfers, compiled
from engines.fmu.variables import Variable
from hub.participant import Inputs
from schemas.errors import ScenarioError, SessionError
from schemas.ros import EmptyMessage

__all__ = ["DISCARD", "GOES_ON", "Instance"]

_log = logging.getLogger(__name__)
_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
DISCARD, _ERROR, _FATAL = 2, 3, 4
"""FMI statuses (fmi2Status, fmi3Status)."""
GOES_ON = True
"""FMI's noSetFMUStatePriorToCurrentPoint: whether a step is told that none before is set again.

A run does not go back; a return to a saved state begins another one. It is said as other importers say it:
a public FMU (`Wheel` of libcosim) stands still where it is False.
"""


class Instance(ABC):
    """A loaded FMU.

    Raises SessionError, with the FMU's own message, whenever a function fails.
    """

    prefix: ClassVar[str]
    """`fmi2` or `fmi3`."""
    counted: ClassVar[bool]
    """The set and get functions take the number of values."""
    state_word: ClassVar[str]
    deserialise_word: ClassVar[str]
    byte: ClassVar[Any]
    """C type of a serialised state's elements."""

    required: ClassVar[Sequence[str]]
    """Functions required of every FMU, without prefix."""

    def __init__(
        self,
        slave: type[Any],
        description: Description,
        name: str,
        options: Sequence[Mapping[str, Any]],
    ) -> None:
        """Unpack and load the FMU through FMPy's class `slave` and instantiate it.

        `options`: sets of arguments of the instantiation, tried in order until the FMU accepts.

        Raises ScenarioError for a refused archive, and for a library that cannot be loaded or lacks a
        required function; SessionError if the FMU refuses all options.
        """
        self._name = name
        self._functions: dict[str, Callable[..., int]] = {}
        self.ended = ""
        """Time and manner of the FMU's end of the simulation; empty: running."""
        self.now_ns = 0
        """Time of the inputs, ns."""
        with contextlib.ExitStack() as stack:
            directory = stack.enter_context(tempfile.TemporaryDirectory(prefix="trocar-fmu-"))
            unpack(description.path, Path(directory))
            library = library_path(description.interface.modelIdentifier, description.major)
            provide_library(description.path, Path(directory), library, description.sources)
            self._fmu = load_library(slave, description, Path(directory), name)
            stack.callback(self._fmu.freeLibrary)
            self.library: Library = self._fmu.dll
            self._check_functions(description)
            self.options = self._instantiate_fmu(description, options)
            """Those that the FMU has taken."""
            self._loaded = stack.pop_all()
        self.can_save = self._can_save(description)
        self.component: int = self._fmu.component
        """Address of the instance."""
        self._initialised = False
        self._worst = 0
        self._state = ctypes.c_void_p()
        self.memory = np.zeros(0)
        """State between steps apart from the FMU's own; written in place, never replaced."""
        self._saving = ()
        if self.can_save:
            word = self.state_word
            self._saving = (f"Get{word}", f"Serialized{word}Size", f"Serialize{word}")
            self._serialise = self._prepare_serialisation()
        self.inputs = [Block("Set", group, self._prepare_access) for group in grouped(description.inputs)]
        self._set_blocks = Transfers(self, [])
        """Inputs set at the start of each step."""
        self.outputs = [Block("Get", group, self._prepare_access) for group in grouped(description.outputs)]
        self._read_blocks = Transfers(self, [block for block in self.outputs if not block.clocks])
        self.text_inputs = TextInputs(self, description.text_inputs)
        self.text_outputs = TextOutputs(self, description.text_outputs)

    def _check_functions(self, description: Description) -> None:
        needed = dict.fromkeys(self.prefix + name for name in self.required)
        bonded = (variable for bond in description.bonds for variable in bond.inputs)
        inputs = (*description.inputs, *bonded)
        needed |= dict.fromkeys(f"{self.prefix}Set{v.type.access}" for v in inputs)
        needed |= dict.fromkeys(f"{self.prefix}Get{v.type.access}" for v in description.outputs)
        needed |= dict.fromkeys(f"{self.prefix}Set{start.access}" for start in description.starts)
        needed |= dict.fromkeys(f"{self.prefix}Set{text.type}" for text in description.text_inputs)
        if missing := self.library.missing(needed):
            raise ScenarioError(
                f"the library of '{description.path}' cannot be used: it lacks {', '.join(missing)}"
            )

    def _instantiate_fmu(
        self, description: Description, options: Sequence[Mapping[str, Any]]
    ) -> Mapping[str, Any]:
        """Instantiate the FMU with the first accepted `options`, and return the options."""
        for which in options:
            try:
                self._fmu.instantiate(**which)
            except Exception as error:  # FMPy raises a bare Exception
                failure = f"'{description.path}' cannot be instantiated{self._reason()}"
                if which is options[-1]:
                    raise SessionError(failure) from error
                _log.warning("%s; it is tried without an option that it says it has", failure)
            else:
                return which
        raise ValueError("there are no options to instantiate an FMU with")

    def _can_save(self, description: Description) -> bool:
        flags = description.interface
        if not (flags.canGetAndSetFMUstate and flags.canSerializeFMUstate):
            return False
        word = self.state_word
        verbs = ("Get", "Set", "Free", "Serialize", self.deserialise_word)
        names = [f"{self.prefix}{verb}{word}" for verb in verbs]
        missing = self.library.missing([*names, f"{self.prefix}Serialized{word}Size"])
        if missing:
            _log.warning("%s: the FMU cannot save its state, its library lacks %s", self._name, missing[0])
        return not missing

    def initialise(self, starts: Sequence[Start], tolerance: float | None) -> None:
        """Set the start values and bring the FMU to time 0."""
        self._initialise(starts, tolerance)
        self._initialised = True
        self.text_inputs.recall()
        self.text_outputs.begin()

    @abstractmethod
    def _initialise(self, starts: Sequence[Start], tolerance: float | None) -> None: ...

    @abstractmethod
    def set_inputs(self, inputs: Inputs, tau: float, dt: float) -> None:
        """Set the inputs for `dt` seconds from `tau` seconds after the start of the step on."""

    @abstractmethod
    def advance(self, t: int, h: int) -> None:
        """Bring the FMU from `t` to `t + h` (ns), or to the FMU's end of the simulation."""

    def bond_input(self, variables: Sequence[Variable]) -> LinearInput:
        """Return the inputs `variables`, all of the same type, as inputs of a bond."""
        return LinearInput(self.block("Set", variables), self.transfer)

    def block(self, verb: Literal["Set", "Get"], variables: Sequence[Variable]) -> Block:
        """Return variables of one type, to be set or got apart from inputs and outputs."""
        return Block(verb, variables, self._prepare_access)

    def set_texts(self, texts: Sequence[tuple[Text, bytes]]) -> None:
        """Set inputs that are texts or bytes."""
        for text, value in texts:
            text.write(value)

    def tune(self, blocks: Sequence[Block]) -> None:
        """Set tunable parameters between two steps."""
        for block in blocks:
            self.transfer(block)

    def get_outputs(self) -> Stop:
        """Bring the FMU's outputs into the blocks, and return where that stopped.

        Clocked ones hold the value of the last tick.
        """
        return self._read_blocks.get()

    def refuse_output(self, at: int, status: int) -> NoReturn:
        """Raise the error of outputs that stopped at block `at` with the FMU's `status`."""
        self._read_blocks.refuse(at, status)

    def take_step(self, t: int, h: int, inputs: Inputs) -> Stop:
        """Take a step from `t` to `t + h` (ns) and get the outputs; return where that stopped."""
        self.now_ns = t
        if not self.ended:
            self.set_inputs(inputs, 0.0, h / 1e9)
        if not self.ended:
            self.advance(t, h)
        return self._read_blocks.get()

    def recall(self) -> None:
        """Take over `memory`, after a return to a saved state."""
        self.text_inputs.recall()

    def take_ticks(self) -> Mapping[str, tuple[EmptyMessage, ...]]:
        """Return the ticks of output clocks since the last call, by port."""
        return {}

    def serialise(self) -> bytes:
        """Return the FMU's state."""
        found = self._serialise()
        if isinstance(found, bytes):
            return found
        at, status = found
        raise self.failure(self._saving[at], status)

    def _prepare_serialisation(self) -> Callable[[], bytes | tuple[int, int]]:
        """Return a call for the state, or for the failed function (place in `_saving`) and its status."""
        if compiled is not None:
            addresses = (*map(self.address, self._saving), self.component, ctypes.addressof(self._state))
            return partial(compiled.serialise, *addresses)
        size = ctypes.c_size_t()
        get, size_of, serialise = map(self._function, self._saving)

        def call() -> bytes | tuple[int, int]:
            if (status := get(self.component, ctypes.byref(self._state))) > WARNING:
                return 0, status
            if (status := size_of(self.component, self._state, ctypes.byref(size))) > WARNING:
                return 1, status
            buffer = (self.byte * size.value)()
            if (status := serialise(self.component, self._state, buffer, size)) > WARNING:
                return 2, status
            return bytes(buffer)

        return call

    def deserialise(self, state: bytes) -> None:
        """Bring the FMU back to a state from `serialise`."""
        self.ended = ""
        self._set_blocks.forget()
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
        """Terminate and free the instance, unload the library and remove the extracted files."""
        with self._loaded:
            if self._worst >= _FATAL:
                return  # no function of the FMU may be called any more (fmi2Fatal, fmi3Fatal)
            if self._state:
                self._function(f"Free{self.state_word}")(self.component, ctypes.byref(self._state))
            if (
                self._initialised
                and self._worst < _ERROR
                and self.library.has(f"{self.prefix}Terminate")
                and self._function("Terminate")(self.component) > WARNING
            ):
                _log.warning("%s: %sTerminate failed%s", self._name, self.prefix, self._reason())
            self._function("FreeInstance")(self.component)

    def call(self, function: str, *arguments: Any) -> None:
        """Call an FMI function, named without prefix."""
        self._check(function, self.status(function, *arguments))

    def status(self, function: str, *arguments: Any) -> int:
        """Call an FMI function, named without prefix, and return FMI's status."""
        return self._function(function)(self.component, *arguments)

    def _check(self, function: str, status: int) -> None:
        if status > WARNING:
            raise self.failure(function, status)

    def failure(self, function: str, status: int, about: str = "") -> SessionError:
        """Return the error for a failed function, and store the severity.

        `about`: purpose of the call, as part of the message.
        """
        self._worst = max(self._worst, status)
        label = _STATUS[status] if 0 <= status < len(_STATUS) else str(status)
        return SessionError(f"{self.prefix}{function} returned '{label}'{about}{self._reason()}")

    def _reason(self) -> str:
        message = last_warning(self._name)
        return f"; the FMU reports: {message}" if message else ""

    def _function(self, name: str) -> Callable[..., int]:
        if name not in self._functions:
            self._functions[name] = getattr(self.library, self.prefix + name)
        return self._functions[name]

    def address(self, name: str) -> int:
        """Return the address of an FMI function, named without prefix."""
        function: Any = self._function(name)
        return ctypes.cast(function, ctypes.c_void_p).value or 0

    def _end(self, time_s: float, how: str) -> None:
        """Note the FMU's request to end the simulation."""
        self.ended = f"the FMU asks to end the simulation at {time_s:.9g} s ({how}){self._reason()}"

    def _prepare_access(
        self, function: str, references: Sequence[int], raw: NDArray[Any]
    ) -> Callable[[], int]:
        return prepared(self._function(function), self.component, references, raw, counted=self.counted)

    def set_changed(self, block: Block) -> None:
        """Set a block of whole numbers or truth values if one has changed, any other in any case."""
        if block.is_changed:
            self.transfer(block)

    def transfer(self, block: Block) -> None:
        """Set or get a block."""
        status = block.call()
        if status > WARNING:
            raise self.refusal(block, status)

    def refusal(self, block: Block, status: int) -> SessionError:
        """Return the error for a block that the FMU refused with `status`."""
        names = block.refused() if status == DISCARD else block.names
        return self.failure(block.function, status, f" for '{names}'")

    def _set_structure(self, starts: Sequence[Start]) -> None:
        """Set structural parameters, in the configuration mode of FMI 3."""
        structural = [start for start in starts if start.structural]
        if structural:
            self.call("EnterConfigurationMode")
            for start in structural:
                self._set_start(start)
            self.call("ExitConfigurationMode")

    def _set_start(self, start: Start) -> None:
        if isinstance(start.value, bytes):
            text = (ctypes.c_char_p * 1)(start.value)
            self.call(
                "SetString", (ctypes.c_uint * 1)(start.reference), 1, text, *([1] if self.counted else [])
            )
            return
        status = self._prepare_access(
            f"Set{start.access}", [start.reference], np.ascontiguousarray(start.value)
        )()
        if status > WARNING:
            raise self.failure(f"Set{start.access}", status, f" for the start value of '{start.name}'")
