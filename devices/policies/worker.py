"""A policy in a process of its own: reads questions from standard input, writes answers to standard output.

The interpreter is the user's choice and need not know Trocar: this file imports the standard library, numpy,
and the policy. No pickle: a frame is a JSON header and the bytes of its arrays.

    4 bytes   length of the header, little-endian
    header    JSON; an array is {"array": [dtype, shape]} there
    arrays    their bytes, in the order of the header
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import json
import os
import struct
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, cast

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Array = NDArray[Any]

__all__ = ["MOST_BYTES", "read_frame", "write_frame"]

MOST_BYTES = 64 * 2**20
"""Largest frame."""
_LENGTH = struct.Struct("<I")
_KINDS = "biuf"


def write_frame(file: BinaryIO, tree: Any) -> None:
    """Write a tree of mappings, lists, texts, numbers and arrays."""
    arrays: list[bytes] = []

    def keep(array: Array) -> dict[str, Any]:
        if array.dtype.kind not in _KINDS:
            raise ValueError(f"an array of {array.dtype} cannot be sent, only numbers")
        arrays.append(np.ascontiguousarray(array).tobytes())
        return {"array": [array.dtype.str, list(array.shape)]}

    def plain(value: object) -> object:
        if isinstance(value, dict):
            return {str(key): plain(part) for key, part in cast("dict[Any, Any]", value).items()}
        if isinstance(value, (list, tuple)):
            return [plain(part) for part in cast("list[Any]", value)]
        if isinstance(value, np.generic):
            return cast("Any", value).item()
        if isinstance(value, np.ndarray):
            return keep(cast("Array", value))
        return value

    header = json.dumps(plain(tree)).encode()
    file.write(b"".join([_LENGTH.pack(len(header)), header, *arrays]))
    file.flush()


def read_frame(file: BinaryIO) -> Any:
    """Return the next tree; raises EOFError at the end, ValueError for a frame that is none."""
    (length,) = _LENGTH.unpack(_read(file, _LENGTH.size))
    if length > MOST_BYTES:
        raise ValueError(f"a header of {length} bytes, at most {MOST_BYTES} are allowed")
    left = MOST_BYTES

    def rebuild(value: Any) -> Any:
        nonlocal left
        if isinstance(value, list):
            return [rebuild(part) for part in cast("list[Any]", value)]
        if not isinstance(value, dict):
            return value
        tree = cast("dict[str, Any]", value)
        if set(tree) != {"array"}:
            return {key: rebuild(part) for key, part in tree.items()}
        name, shape = tree["array"]
        dtype = np.dtype(name)
        size = dtype.itemsize
        for count in shape:
            if not isinstance(count, int) or count < 0:
                raise ValueError(f"an array of shape {shape}")
            size *= count
        left -= size
        if dtype.kind not in _KINDS or left < 0:
            raise ValueError(f"an array of {dtype}, {size} bytes; at most {MOST_BYTES} in all are allowed")
        return np.frombuffer(_read(file, size), dtype).reshape(shape)

    return rebuild(json.loads(_read(file, length)))


def _read(file: BinaryIO, count: int) -> bytes:
    data = b""
    while len(data) < count:
        part = file.read(count - len(data))
        if not part:
            raise EOFError("the other side has ended")
        data = part if not data else data + part
    return data


class _Served:
    """A function `f(observation)`, or an object with `act(observation)` and `reset(episode)`."""

    def __init__(self, found: Any) -> None:
        self._act: Callable[..., Any] = getattr(found, "act", found)
        self._reset: Callable[..., Any] | None = getattr(found, "reset", None)
        self.metadata: Any = getattr(found, "metadata", {})

    def reset(self, episode: int) -> None:
        if self._reset is not None:
            self._reset(episode)

    def act(self, observation: dict[str, Any]) -> Array:
        return np.asarray(self._act(observation))


def _find(prefix: str, place: str, contract: Any) -> Any:
    """Return the policy behind an address."""
    if prefix in _OWN:
        file, name = _OWN[prefix]
        return getattr(_load(Path(__file__).resolve().with_name(file)), name)(place, contract)
    module, _, name = place.rpartition(":")
    if module.endswith(".py"):
        path = Path(module).resolve()
        sys.path.insert(0, str(path.parent))
        found: Any = _load(path)
    else:
        found = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    return _make(cast("Callable[..., Any]", found), contract) if inspect.isclass(found) else found


def _make(make: Callable[..., Any], contract: Any) -> Any:
    return make(contract) if inspect.signature(make).parameters else make()


def _load(path: Path) -> Any:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"no Python file '{path}'")
    found = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = found
    spec.loader.exec_module(found)
    return found


_OWN = {"onnx": ("onnx_model.py", "OnnxModel"), "lerobot": ("lerobot_checkpoint.py", "LeRobotCheckpoint")}
"""File and class of the policies that are files themselves, by prefix."""


def main() -> None:
    """Serve one policy until the standard input ends."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what the policy prints must not be taken for answers
    questions = sys.stdin.buffer
    first = read_frame(questions)
    sys.path[0] = first["directory"]  # instead of the directory of this file
    os.chdir(first["directory"])
    try:
        prefix, _, place = first["backend"].partition(":")
        policy = _Served(_find(prefix, place, first["contract"]))
        write_frame(answers, {"metadata": policy.metadata})
    except Exception as error:  # noqa: BLE001  # it is sent to the session, which names it
        traceback.print_exc()
        write_frame(answers, {"error": _describe(error)})
        return
    while True:
        try:
            question = read_frame(questions)
        except EOFError:
            return
        answer: dict[str, Any] = {"number": question["number"]}
        try:
            if "episode" in question:
                policy.reset(question["episode"])
            else:
                answer["actions"] = policy.act(question["observation"])
            write_frame(answers, answer)
        except Exception as error:  # noqa: BLE001  # it is sent to the session, which names it
            traceback.print_exc()
            write_frame(answers, {"number": question["number"], "error": _describe(error)})


def _describe(error: BaseException) -> str:
    place = traceback.extract_tb(error.__traceback__)[-1]
    return f"{type(error).__name__}: {error} ({Path(place.filename).name}, line {place.lineno})"


if __name__ == "__main__":
    main()
