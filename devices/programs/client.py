"""A session as seen by a program: its arms and cameras, by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Self

from devices.programs.arm import Arm
from devices.programs.camera import Camera
from devices.programs.connection import Connection
from schemas.errors import did_you_mean

__all__ = ["Client"]


class Client:
    """A running session, led by a program: `with trocar.connect() as s: s.PSM1.move_jp(q).wait()`.

    Arms and cameras are attributes, by the names in the session. For one thread.
    """

    if TYPE_CHECKING:
        PSM1: Arm
        PSM2: Arm
        PSM3: Arm
        ECM: Arm
        endoscope: Camera

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        published = connection.published
        self._arms: dict[str, Arm | None] = {
            name: None
            for topic in connection.commands
            if "/" not in (name := topic[1:].removesuffix("/move_jp")) and f"/{name}/setpoint_js" in published
        }
        self._cameras = {
            name: Camera(connection, name)
            for topic in published
            if "/" not in (name := topic[1:].removesuffix("/left/image_raw"))
            and f"/{name}/left/image_raw" in published
        }

    @property
    def arms(self) -> tuple[str, ...]:
        """Names of the arms."""
        return tuple(self._arms)

    @property
    def cameras(self) -> Mapping[str, Camera]:
        """The stereo cameras, by name."""
        return self._cameras

    def arm(self, name: str) -> Arm:
        """Return the arm `name`. Raises AttributeError for an unknown name."""
        if name not in self._arms:
            raise AttributeError(
                f"{self._connection.label} has no arm '{name}'.{did_you_mean(name, self._arms)}"
            )
        if (arm := self._arms[name]) is None:
            arm = self._arms[name] = Arm(self._connection, name)
        return arm

    def close(self) -> None:
        """Leave the session; the session goes on, and arms finish their moves."""
        self._connection.close()

    def __getattr__(self, name: str) -> Arm | Camera:
        if name.startswith("_"):
            raise AttributeError(name)
        if name in self._cameras:
            return self._cameras[name]
        if name in self._arms:
            return self.arm(name)
        hint = did_you_mean(name, (*self._arms, *self._cameras))
        raise AttributeError(f"{self._connection.label} has no '{name}'.{hint}")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._arms, *self._cameras]

    def __repr__(self) -> str:
        return f"<{self._connection.label}: {', '.join((*self._arms, *self._cameras))}>"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
