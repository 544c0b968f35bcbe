"""An ONNX model as a policy, run by onnxruntime on the CPU, in the process of `worker.py`.

Inputs are found by name: `state` or `observation.state`, and pictures as `observation.images.<camera>` or the
camera's name, `/` as `_` or `.`. A picture goes in as the model declares it: 3 channels first or last; floats
from 0 to 1, or bytes. The first output is the rows, shape (rows, width) or (1, rows, width).
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["OnnxModel"]

_FLOATS = {"tensor(float)": np.float32, "tensor(float16)": np.float16, "tensor(double)": np.float64}
_BYTES = "tensor(uint8)"


class OnnxModel:
    """A model in a file."""

    def __init__(self, file: str, contract: dict[str, Any]) -> None:
        """Load the model. Raises ValueError for an input that a session does not have."""
        onnxruntime: Any = import_module("onnxruntime")  # by name: it has no types
        self._model: Any = onnxruntime.InferenceSession(file, providers=["CPUExecutionProvider"])
        self._inputs = {one.name: one for one in self._model.get_inputs()}
        self._sources = {name: _source(name, contract) for name in self._inputs}
        self.metadata: dict[str, Any] = {"contract": self._statement(contract)}

    def act(self, observation: dict[str, Any]) -> NDArray[Any]:
        """Return the rows."""
        values = {
            name: _state(observation["state"], one.type)
            if (camera := self._sources[name]) == ""
            else _picture(observation["images"][camera], one)
            for name, one in self._inputs.items()
        }
        return np.asarray(self._model.run(None, values)[0])

    def _statement(self, contract: dict[str, Any]) -> dict[str, Any]:
        """Return what the shapes say: width of rows, size of the state."""
        found: dict[str, Any] = {}
        width = self._model.get_outputs()[0].shape[-1:]
        if width and isinstance(width[0], int):
            found["action"] = width[0]
        for name, one in self._inputs.items():
            if self._sources[name] == "" and one.shape and isinstance(one.shape[-1], int):
                found["state"] = one.shape[-1]
        needed = [camera for camera in self._sources.values() if camera]
        return {**found, "cameras": {camera: contract["cameras"][camera] for camera in needed}}


def _source(name: str, contract: dict[str, Any]) -> str:
    """Return the camera of an input; empty: the state."""
    plain = name.replace("observation.images.", "").replace("observation.", "")
    if plain == "state":
        return ""
    for camera in contract["cameras"]:
        if plain in (camera, camera.replace("/", "_"), camera.replace("/", ".")):
            return camera
    known = ", ".join(["state", *contract["cameras"]])
    raise ValueError(f"the model has an input '{name}'; the contract has {known}")


def _state(state: NDArray[Any], kind: str) -> NDArray[Any]:
    return state[None].astype(_FLOATS[kind])


def _picture(pixels: NDArray[np.uint8], one: Any) -> NDArray[Any]:
    """Return a picture as an input declares it, with the batch's dimension."""
    values: NDArray[Any] = pixels if one.type == _BYTES else (pixels / 255.0).astype(_FLOATS[one.type])
    if len(one.shape) == 4 and one.shape[1] == 3:
        values = values.transpose(2, 0, 1)
    return np.ascontiguousarray(values)[None]
