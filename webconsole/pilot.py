"""Pilots of devices: at most a single page a device, by a lease until the page's end or silence."""

from __future__ import annotations

from collections.abc import Callable, Collection
from time import monotonic
from typing import Any, NamedTuple

from devices.browser import Obedience
from schemas.errors import MessageError, did_you_mean
from webconsole.commands import Hand

__all__ = ["Offer", "Pilots"]

LEASE_S = 3.0
"""Silence of a leading page until the lead ends, s."""


class Offer(NamedTuple):
    """A device for pages to lead."""

    take: Callable[[Hand | None], None]
    """Gets the wishes of the pages, and None when no page leads."""
    obedience: Callable[[], Obedience]
    """Returns how the device follows the page now."""
    exchange: Callable[[str], None]
    """Asks for an instrument, for the arm that the device leads."""


class Pilots:
    """The devices for pages to lead, and the leading page of each."""

    def __init__(self) -> None:
        self._devices: dict[str, Offer] = {}
        self._pages: dict[str, object] = {}
        self._heard_s: dict[str, float] = {}
        self._numbers: dict[str, int] = {}
        self._people: dict[object, int] = {}

    def offer(self, device: str, offer: Offer) -> None:
        """Let pages lead a device."""
        self._devices[device] = offer

    def keep(self, devices: Collection[str]) -> None:
        """Offer no others than these: another session is shown."""
        for device in self._devices.keys() - set(devices):
            if device in self._pages:
                self._release(device)
            del self._devices[device]

    def lead(self, page: object, device: str, *, beside: bool = False) -> None:
        """Make `page` the pilot of `device`, and of no further device unless `beside` is true.

        Raises MessageError if there is no such device, or the device has a pilot.
        """
        if device not in self._devices:
            raise MessageError(
                f"no device '{device:.80}' can be led from a page.{did_you_mean(device, self._devices)}"
            )
        self._expire_leads()
        holder = self._pages.get(device)
        if holder is not None and holder is not page:
            raise MessageError(f"page {self._number_of(holder)} leads '{device}': it must leave first")
        if not beside:
            self.leave(page)
        self._pages[device], self._heard_s[device], self._numbers[device] = page, monotonic(), -1

    def leave(self, page: object) -> None:
        """Let `page` lead nothing."""
        for device in [name for name, holder in self._pages.items() if holder is page]:
            self._release(device)

    def pass_on(self, page: object, hand: Hand) -> None:
        """Pass a page's wish to the page's device; raises MessageError if the page leads no such device."""
        led = [name for name, holder in self._pages.items() if holder is page]
        if not led:
            raise MessageError("this page leads no device")
        device = hand.device or led[0]
        if device not in led:
            raise MessageError(f"this page does not lead '{device:.80}'; it leads {', '.join(led)}")
        if hand.number <= self._numbers[device]:
            raise MessageError(f"input {hand.number} is old: {self._numbers[device]} was here")
        self._devices[device].take(hand)
        self._numbers[device], self._heard_s[device] = hand.number, monotonic()

    def exchange(self, page: object, device: str, instrument: str) -> None:
        """Ask for an instrument for the arm of a device that `page` leads; raises MessageError otherwise."""
        if self._pages.get(device) is not page:
            raise MessageError(f"this page does not lead '{device:.80}': lead it to exchange its instrument")
        self._devices[device].exchange(instrument)

    def leads(self, page: object) -> bool:
        """Return whether `page` leads a device."""
        return page in self._pages.values()

    def obediences(self, page: object) -> dict[str, Obedience]:
        """Return how each device that `page` leads follows it."""
        return {
            device: self._devices[device].obedience() for device, held in self._pages.items() if held is page
        }

    def state(self, page: object) -> list[dict[str, Any]]:
        """Return each device and its pilot, as `page` is told, ready for JSON."""
        self._expire_leads()
        rows: list[dict[str, Any]] = []
        for device in sorted(self._devices):
            holder = self._pages.get(device)
            who = "" if holder is None else "you" if holder is page else f"page {self._number_of(holder)}"
            rows.append({"device": device, "pilot": who})
        return rows

    def _expire_leads(self) -> None:
        now = monotonic()
        for device in [name for name in self._pages if now - self._heard_s[name] > LEASE_S]:
            self._release(device)

    def _release(self, device: str) -> None:
        del self._pages[device]
        self._devices[device].take(None)

    def _number_of(self, page: object) -> int:
        return self._people.setdefault(page, len(self._people) + 1)
