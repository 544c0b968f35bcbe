"""Texts and bytes of an FMU (FMI's String and Binary) as messages: `std_msgs` String and UInt8MultiArray.

Values have no numbers and any length, so each variable is set and got by a call of its own. An input is set
when a message differs from the value of the FMU.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from engines.fmu.blocks import WARNING
from hub.participant import Inputs
from schemas.errors import SessionError
from schemas.message import Message
from schemas.ros import StringMessage, UInt8MultiArray

if TYPE_CHECKING:
    from engines.fmu.instance import Instance

__all__ = ["MESSAGES", "Text", "TextInputs", "TextOutputs", "TextVariable"]

_log = logging.getLogger(__name__)

MESSAGES: dict[str, type[Message]] = {"String": StringMessage, "Binary": UInt8MultiArray}
"""Message by FMI type."""
LARGEST = 64 << 20
"""Most bytes of a value: a larger one would fill the memory of all hosts at every step."""


@dataclass(frozen=True)
class TextVariable:
    """An input or output of an FMU whose value is a text or bytes."""

    name: str
    port: str
    reference: int
    """FMI's value reference."""
    type: str
    """`String` or `Binary`."""


class Text:
    """A variable of an instance, with the calls for one value."""

    def __init__(self, instance: Instance, variable: TextVariable) -> None:
        """Prepare the calls."""
        self._instance, self._variable = instance, variable
        self.name, self.port = variable.name, variable.port
        self._is_binary = variable.type == "Binary"
        self._reference = (ctypes.c_uint * 1)(variable.reference)
        self._value, self._size = (ctypes.c_void_p * 1)(), (ctypes.c_size_t * 1)()
        element = ctypes.POINTER(ctypes.c_uint8) if self._is_binary else ctypes.c_char_p
        sizes = [self._size] if self._is_binary else []
        values = ctypes.cast(self._value, ctypes.POINTER(element))
        self._arguments = self._reference, 1, *sizes, values, *([1] if instance.counted else [])

    @property
    def readable(self) -> bool:
        """Whether the FMU gives the value: some have no function for it, or one that always fails."""
        instance, function = self._instance, f"Get{self._variable.type}"
        has = instance.library.has(instance.prefix + function)
        return has and instance.status(function, *self._arguments) <= WARNING

    def read(self) -> bytes:
        """Return the FMU's value: UTF-8 or bytes."""
        self._call("Get")
        address, size = self._value[0], self._size[0]
        if address is None and not (self._is_binary and size == 0):
            what = f"{size} bytes" if self._is_binary else "a text"
            raise SessionError(f"'{self.name}' has no value: the FMU returned a null pointer for {what}")
        if address is None:
            return b""
        self._check_size(size if self._is_binary else 0)
        value = ctypes.string_at(address, size) if self._is_binary else ctypes.string_at(address)
        self._check_size(len(value))
        return value

    def write(self, value: bytes) -> None:
        """Set the value: UTF-8 without a zero byte, or bytes."""
        buffer = ctypes.create_string_buffer(value)  # with a zero at the end
        self._value[0], self._size[0] = ctypes.addressof(buffer), len(value)
        self._call("Set")
        self._value[0] = None

    def message(self, value: bytes) -> Message:
        """Return a value as a message."""
        if self._is_binary:
            return UInt8MultiArray(data=np.frombuffer(value, np.uint8))
        try:
            return StringMessage(data=value.decode())
        except UnicodeDecodeError as error:
            raise SessionError(f"output '{self.name}' is no text in UTF-8: {error}") from error

    def value(self, message: Message) -> bytes:
        """Return the value of a message."""
        if self._is_binary:
            return cast("UInt8MultiArray", message).data.tobytes()
        value = cast("StringMessage", message).data.encode()
        if b"\0" in value:
            raise SessionError(f"input '{self.name}' takes a text without zero characters")
        return value

    def _call(self, verb: str) -> None:
        function = f"{verb}{self._variable.type}"
        status = self._instance.status(function, *self._arguments)
        if status > WARNING:
            raise self._instance.failure(function, status, f" for '{self.name}'")

    def _check_size(self, size: int) -> None:
        if size > LARGEST:
            raise SessionError(f"'{self.name}' has {size} bytes, at most {LARGEST} are passed on in a step")


class TextInputs:
    """The inputs of an instance that are texts or bytes."""

    def __init__(self, instance: Instance, variables: Sequence[TextVariable]) -> None:
        """Find the variables; `recall` reads their values."""
        self._texts = [Text(instance, variable) for variable in variables]
        self._known: dict[str, bytes] = {}

    def recall(self) -> None:
        """Take the values from the FMU: at the start, and after a return to a saved state."""
        self._known = {text.port: text.read() for text in self._texts if text.readable}

    def changed(self, inputs: Inputs) -> list[tuple[Text, bytes]]:
        """Return the inputs with a new value; without a message the FMU keeps its own."""
        found: list[tuple[Text, bytes]] = []
        for text in self._texts:
            message = inputs.message(text.port)
            if isinstance(message, Message) and (value := text.value(message)) != self._known.get(text.port):
                self._known[text.port] = value
                found.append((text, value))
        return found

    def values(self) -> list[bytes]:
        """Return the values in effect."""
        return [*self._known.values()]


class TextOutputs:
    """The outputs of an instance that are texts or bytes."""

    def __init__(self, instance: Instance, variables: Sequence[TextVariable]) -> None:
        """Find the variables."""
        self._texts = [Text(instance, variable) for variable in variables]
        self._known: dict[str, tuple[bytes, Any]] = {}

    def begin(self) -> None:
        """Leave out, at the start, what the FMU does not give."""
        for text in [text for text in self._texts if not text.readable]:
            _log.warning("output '%s' stays empty: the FMU does not give its value", text.name)
            self._texts.remove(text)
            self._known[text.port] = b"", text.message(b"")

    def get(self) -> dict[str, Message]:
        """Return the values by port; a value that stays is the same message."""
        for text in self._texts:
            value = text.read()
            if self._known.get(text.port, (None,))[0] != value:
                self._known[text.port] = value, text.message(value)
        return {port: message for port, (_, message) in self._known.items()}

    def values(self) -> list[bytes]:
        """Return the values in effect."""
        return [value for value, _ in self._known.values()]
