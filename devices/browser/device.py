"""Keys, pointer and gamepad of a page in place of a stylus or a headset (kind `browser`).

The server of the page hosts the device (`host: remote`), so the samples travel as with every other device.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from devices.browser.page_hand import Obedience, PageInput, hand_of
from devices.diagnosis import Diagnosis, Level
from devices.keyboard.virtual_hand import VirtualHand, VirtualHandParams
from devices.keyboard.virtual_stylus import Wish
from hub.participant import Params, Sample, event_out
from schemas.ports import Port
from schemas.quantity import Duration
from schemas.ros import StringMessage

__all__ = ["Browser", "BrowserParams"]

_EXCHANGE = event_out(
    "set_tool_type", StringMessage, "instrument that the led arm gets in exchange", clock="wall"
)

_WAY_NS = 2_000_000
"""Time from a read to the communication point, on the same machine, ns (bench/webconsole_session.py)."""


class BrowserParams(VirtualHandParams):
    """Frame moved from a page, speeds, and longest silence of an obeyed page."""

    silence: Annotated[
        Duration,
        Field(gt=0, le=1_000_000_000, description="the arm holds once a page has sent nothing for so long"),
    ] = 100_000_000


class Browser(VirtualHand):
    """Publishes `pose`, `twist`, `buttons`, `gripper` and `diagnostics` like a stylus, led from a page.

    `set_tool_type` asks for an instrument in exchange, when the leading page does.
    While no page leads, or the leading page is silent, only the diagnostics: the arm holds. The moved frame
    starts at the origin of `<participant>_base`, pointing level away from the user.
    """

    params_model: ClassVar[type[Params]] = BrowserParams
    params: BrowserParams

    longest_pause_ns = 50_000_000

    @property
    def ports(self) -> tuple[Port, ...]:
        """Those of a virtual hand, and `set_tool_type`."""
        return *super().ports, _EXCHANGE

    def _reset(self) -> None:
        super()._reset()
        self._hand = hand_of(self.name)
        silence = self.params.silence  # the last read that is in time lets go
        self._longest_age_ns = silence - min(round(1e9 / self.params.rate) + _WAY_NS, silence // 4)
        self._lead, self._dragged = -1, np.zeros(3)
        self._moved_ns = 0
        self._interrupted = self._spent = False

    def open(self, directory: Path) -> None:  # noqa: ARG002
        """Wait for a page."""
        self._diagnosis = Diagnosis(self.name)
        self._reset()

    def read(self, t: int) -> list[Sample]:
        """Return the present pose and twist, and changed buttons and diagnoses."""
        if not self._timer.due(t):
            return []
        seconds = self._elapse(t)
        newest = self._hand.newest()
        if newest is None:
            self._spent |= self._pressed[0] or self._interrupted
            self._hand.obedience = Obedience.UNLED
            return self._press(t, Wish()) + self._diagnosis.report(Level.WARN, self._describe_missing_lead())
        asked, age_ns, lead = newest
        if asked.away:
            self._spent |= self._pressed[0] or self._interrupted
            self._hand.obedience = Obedience.AWAY
            return self._press(t, Wish()) + self._diagnosis.report(
                Level.OK, "the page that leads is not in front: the arm holds"
            )
        if age_ns > self._longest_age_ns:
            return self._hold(t)
        self._hand.obedience = self._obey(t, held=asked.wish.dead_man)
        if self._spent:
            asked = replace(asked, wish=Wish())
        samples = self._press(t, asked.wish) + self._diagnosis.report(Level.OK, "a page leads")
        if instrument := self._hand.take_instrument():
            samples.append(Sample(_EXCHANGE.name, StringMessage(data=instrument)))
        if asked.tracked is None:
            self._stylus.advance(self._with_drag(asked, lead, seconds), seconds)
        elif asked.wish.dead_man:
            self._stylus.follow(*asked.tracked, asked.wish.gripper, seconds)
        else:  # the clutch is open: hand and stylus meet, and the arm holds
            self._stylus.place(*asked.tracked)
        self._moved_ns = t
        return samples + self._motion(t)

    def _hold(self, t: int) -> list[Sample]:
        """Let go while the page is silent."""
        self._interrupted |= self._pressed[0]
        samples = self._press(t, Wish())
        if not self._is_stale(t):
            self._hand.obedience = Obedience.SILENT
            return samples
        self._spent |= self._interrupted
        self._hand.obedience = Obedience.SPENT if self._spent else Obedience.SILENT
        return samples + self._diagnosis.report(Level.WARN, "the page that leads is silent: the arm holds")

    def _obey(self, t: int, *, held: bool) -> Obedience:
        """Return how the arm follows an input that is in time.

        After a silence, a held dead-man goes on if the pose never was stale; else it has to be pressed anew.
        """
        self._spent = held and (self._spent or (self._interrupted and self._is_stale(t)))
        self._interrupted = False
        if self._spent:
            return Obedience.SPENT
        return Obedience.MOVES if held else Obedience.OPEN

    def _is_stale(self, t: int) -> bool:
        return t - self._moved_ns > self.params.max_age

    def _describe_missing_lead(self) -> str:
        if self._hand.served:
            return f"no page leads: choose 'Lead {self.name}' on the page of `trocar view`"
        return (
            "no page can lead: the page's server hosts this device; set `host: remote` in the scenario, and"
            " run it with --open"
        )

    def _with_drag(self, asked: PageInput, lead: int, seconds: float) -> Wish:
        """Return the command with the rest of the pointer's way, as fast as the stylus may move."""
        if lead != self._lead:
            self._lead, self._dragged = lead, np.array(asked.drag)
        left = np.array(asked.drag) - self._dragged
        most = self.params.speed * seconds
        if not most or not left.any():
            return asked.wish
        share = left / max(most, float(np.linalg.norm(left)))
        self._dragged = self._dragged + share * most
        ahead, sideways, up = share.tolist()
        return asked.wish + Wish(linear=(ahead, sideways, up))

    def close(self) -> None:
        """Obey no page any more."""
