"""The hub's interface to a device with programs of its own at the hub's Zenoh router."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import zenoh

__all__ = ["RouterClient"]


@runtime_checkable
class RouterClient(Protocol):
    """A device sharing the hub's router with programs outside Trocar, such as a gateway to ROS 2."""

    @property
    def foreign_keys(self) -> tuple[str, ...]:
        """Zenoh keys, none of Trocar's own, for the programs and this device at the hub's router.

        Holders of the certificate `console` may use these keys.
        """
        ...

    @property
    def demands_secret(self) -> bool:
        """Whether programs of this machine need the secret of the session, as hosts do.

        If not, every user of this machine may use the keys, at a separate router.
        """
        ...

    def learn_hub(self, connect: Callable[[], zenoh.Session]) -> None:
        """Receive, before `open`, a function to open a Zenoh session of the device's own with the hub."""
        ...
