"""The value of a signal at one instant, with the names of its numbers."""

from __future__ import annotations

from schemas.errors import SessionError, did_you_mean
from schemas.vectors import Vector, VectorCodec

__all__ = ["Reading"]


class Reading:
    """A value with names, as `Series` has of a recording.

        joints = session.read("robot.PSM1/measured_js")
        joints.names                    # ("yaw", "pitch", "insertion", ...)
        joints["position"]              # (6,), rad and m, in the order of joints.names
        joints["position.insertion"]    # m

    Attributes:
        name: The port, `participant.port`.
        values: All numbers, shape (size,); quaternions are (x, y, z, w).
    """

    __slots__ = ("_codec", "name", "values")

    def __init__(self, name: str, values: Vector, codec: VectorCodec) -> None:
        self.name, self.values, self._codec = name, values, codec

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints; empty if these are no joints."""
        return self._codec.port.names

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the parts: `position`, `velocity`; `position`, `orientation`; `data`; ..."""
        return tuple(self._codec.parts)

    @property
    def columns(self) -> tuple[str, ...]:
        """Name of each number in `values`: `position.x`, `velocity.insertion`, `data.0`."""
        return tuple(self._codec.columns)

    @property
    def unit(self) -> str:
        """Unit of a bare number or array; empty where the type implies SI units."""
        return self._codec.port.unit

    @property
    def frame(self) -> str:
        """Frame of the value; empty without a frame."""
        return self._codec.port.frame

    def __getitem__(self, name: str) -> Vector:
        """Return a part, shape (width,) or of a matrix its shape, or a number, shape ().

        Raises SessionError for a name in neither `fields` nor `columns`.
        """
        codec = self._codec
        if name in codec.parts:
            return self.values[codec.parts[name]].reshape(codec.port.shape or -1)
        if name in codec.columns:
            return self.values[codec.columns[name]]
        hint = did_you_mean(name, [*codec.parts, *codec.columns])
        raise SessionError(f"port '{self.name}' has no field '{name}'.{hint}")

    def __repr__(self) -> str:
        numbers = ", ".join(
            f"{name} {value:.6g}" for name, value in zip(self.columns, self.values.tolist(), strict=True)
        )
        return f"<Reading {self.name}: {numbers}>"
