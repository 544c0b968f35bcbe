"""A page's connection: the newest frames out, the page's commands in, done or refused."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Sequence
from time import monotonic, monotonic_ns
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from hub.participant.token_bucket import TokenBucket
from schemas.errors import MessageError, TrocarError
from webconsole.commands import (
    At,
    Command,
    Control,
    End,
    Exchange,
    Fork,
    Hand,
    Invite,
    Lead,
    Leave,
    Network,
    Pick,
    Prepare,
    Say,
    Show,
    Start,
    Tune,
    Watch,
    command,
    command_name,
)
from webconsole.console import Console
from webconsole.frame import frame, parse_acknowledgement
from webconsole.gate import Gate, Role
from webconsole.live import Live
from webconsole.new_sections import NewSections
from webconsole.stage import Stage

__all__ = ["Page"]

log = logging.getLogger(__name__)

_FRAME_S = 1.0 / 60.0
_STATE_S = 0.25
_OTHER_SOURCE = 4001
"""Close code for a page that is to load again; RFC 6455 leaves 4000 to 4999 to applications."""
_MOST_WAITING = 2
"""Unacknowledged frames of a page; with so many, newer values replace the values not yet sent."""
_MOST_PROBLEMS = 50
"""Damaged values reported to a page."""
_MESSAGES_PER_S = 400.0
"""Messages of a page, 1/s: 60 acknowledgements, 120 inputs of a hand, and a burst after a pause."""
_MOST_REFUSED = 200
"""Invalid messages until a page is closed."""


class Page:
    """The server's side of a page.

    Args:
        socket: WebSocket of the page.
        role: Rights of the page.
        console: Shared by all pages.
        gate: Makes links for more browsers.
    """

    def __init__(self, socket: WebSocket, role: Role, console: Console, gate: Gate) -> None:
        self._socket, self._role, self._console, self._gate = socket, role, console, gate
        self._stage: Stage | None = None
        self._generation = -1
        self._show = Show(do="show")
        self._at_ns: int | None = None
        self._number = self._acknowledged = 0
        self._new = NewSections(console)
        self._told: set[str] = set()
        """Problems already told to the page."""
        self._led: dict[str, dict[str, str]] = {}
        """How the devices follow the page, as told to the page."""
        self._lines = 0
        self._rate = TokenBucket(_MESSAGES_PER_S)
        self._refused = 0
        self._changed = asyncio.Event()

    async def run(self) -> None:
        """Serve the page until the socket closes."""
        await self._socket.accept()
        tasks = [asyncio.create_task(work) for work in (self._read(), self._frames(), self._states())]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                error = task.exception()
                if error is None:
                    continue
                if not isinstance(error, WebSocketDisconnect | RuntimeError):
                    raise error
                log.debug("a page has gone: %s", error)  # Starlette's errors of a socket that is closed
        finally:
            self._console.pilots.leave(self)
            self._console.want(self, None)
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _read(self) -> None:
        while True:
            message = await self._socket.receive()
            if message["type"] != "websocket.receive":
                return
            if not self._rate.spend(monotonic_ns()):
                await self._refuse("", f"more than {_MESSAGES_PER_S:g} messages/s")
                continue
            await self._receive(message.get("text"), message.get("bytes"))
            if self._refused > _MOST_REFUSED:
                log.warning("a page is closed: %d invalid messages", self._refused)
                await self._socket.close(1008, "too many invalid messages")
                return

    async def _receive(self, text: str | None, data: bytes | None) -> None:
        asked = ""
        try:
            if data is not None:
                number = parse_acknowledgement(data)
                if not self._acknowledged < number <= self._number:
                    raise MessageError(f"frame {number} is acknowledged, the last one was {self._number}")
                self._acknowledged = number
                self._changed.set()
                return
            order = command(text or "")
            asked = order.do
            if self._role == "viewer" and not isinstance(order, Show | At):
                raise MessageError("a viewer may look, and nothing else: ask the operator for a link")
            answer = await self._execute_order(order)
        except TrocarError as error:
            await self._refuse(asked or command_name(text or ""), str(error))
            return
        if answer is not None:
            await self._tell({"is": "answer", "to": asked, **answer})

    async def _execute_order(self, order: Command) -> dict[str, Any] | None:
        """Carry out a command of the page; raises TrocarError."""
        match order:
            case Show():
                self._show = order
                if order.again:
                    self._new.send_all()
                self._want()
            case At():
                self._at_ns = None if order.time is None else self._past_ns(order.time)
            case Hand():
                self._console.pilots.pass_on(self, order)
                return None
            case Lead():
                self._console.pilots.lead(self, order.device, beside=order.beside)
                self._return_to_present()
                return {"device": order.device}
            case Exchange():
                self._console.pilots.exchange(self, order.device, order.instrument)
                return {}
            case Leave():
                self._console.pilots.leave(self)
            case Control():
                await self._console.control(order)
                return {}
            case Network():
                await self._console.network(order)
                return {}
            case Tune():
                await self._console.tune(order)
                return {}
            case Pick() | Say():
                await self._console.guide(order)
                return {}
            case Prepare():
                await self._console.prepare()
            case Fork():
                return {"number": await self._console.fork(order)}
            case Start():
                return await self._console.start(order)
            case End():
                self._console.started.end(order.number)
                return {}
            case Watch():
                self._console.live_source().watch(order.session)
            case Invite():
                return {"path": self._gate.invite(order.role), "role": order.role}
        self._changed.set()
        return None

    def _return_to_present(self) -> None:
        """Show the present again."""
        self._at_ns = None
        self._changed.set()

    def _past_ns(self, time_s: float) -> int:
        """Return a time of the past in ns; raises MessageError if the page has no past to show."""
        source = self._console.source
        if isinstance(source, Live):
            if source.past is None:
                raise MessageError("this session is not recorded on this machine: it has no past to show")
            if self._console.pilots.leads(self):
                raise MessageError("who leads a device sees what runs now: leave it first")
        return round(time_s * 1e9)

    async def _refuse(self, asked: str, why: str) -> None:
        self._refused += 1
        if self._refused <= 3 or self._refused % 50 == 0:
            log.warning("a message of a page is refused (%d): %s", self._refused, why[:300])
        if self._refused <= _MOST_REFUSED:
            await self._tell({"is": "answer", "to": asked, "error": why[:500]})

    async def _tell(self, content: dict[str, Any]) -> None:
        await self._socket.send_text(
            json.dumps(content, separators=(",", ":"), allow_nan=False, default=float)
        )

    async def _states(self) -> None:
        """Send the state of the page's head and the log, a few times a second."""
        source = self._console.source
        while True:
            if self._console.source is not source:
                await self._socket.close(_OTHER_SOURCE, "the session has ended; its recording is shown")
                return
            if source.generation != self._generation:
                await self._begin()
            card, problem = self._score_card()
            state = dict(source.state)
            await self._tell_problems([*state.pop("problems", ()), *problem, *self._new.problems.values()])
            pilots = self._console.pilots.state(self)
            content: dict[str, Any] = {"is": "state", **state, "pilots": pilots, "card": card}
            content["guide"] = self._console.guided_work()
            if self._role == "operator":  # their links are an operator's
                content["started"] = self._console.started.as_json()
            if isinstance(source, Live):
                self._lines, lines = source.entries_after(self._lines)
                content["log"] = [entry.as_json() for entry in lines]
            await self._tell(content)
            await asyncio.sleep(_STATE_S)

    def _score_card(self) -> tuple[dict[str, Any] | None, list[str]]:
        """Return the score card, or why the card cannot be read."""
        try:
            return self._console.card(self._at_ns), []
        except TrocarError as error:
            return None, [f"the score card: {error}"]

    async def _tell_problems(self, problems: Sequence[str]) -> None:
        """Tell the page of damaged values, each once."""
        for text in problems:
            if text not in self._told and len(self._told) < _MOST_PROBLEMS:
                self._told.add(text)
                await self._tell({"is": "trouble", "text": f"not shown: {text[:500]}"})

    async def _begin(self) -> None:
        """Describe a session new to this page."""
        generation = self._console.source.generation
        stage = await self._console.stage()
        self._generation = generation
        self._new, self._stage, self._told = NewSections(self._console), stage, set()
        if self._console.source.kind == "live":
            self._return_to_present()
        described = {} if stage is None else stage.describe()
        await self._tell(
            {
                "is": "session",
                "kind": self._console.source.kind,
                "role": self._role,
                "generation": generation,
                "guided": self._console.source.guided,
                **described,
            }
        )
        self._want()

    def _want(self) -> None:
        stage = self._stage
        if stage is not None:
            pictures = stage.pictures if self._show.pictures else ()
            numbers = (name for name in self._show.numbers if stage.is_numeric(name))
            self._console.want(self, stage.shown.union(pictures, numbers))

    async def _tell_led(self) -> None:
        """Tell the page how the devices that it leads follow it, if this has changed."""
        found = self._console.led(self, self._stage)
        if found != self._led:
            self._led = found
            await self._tell({"is": "led", "devices": found})

    async def _frames(self) -> None:
        live, due_s = self._console.source.kind == "live", monotonic()
        while True:
            if live and self._at_ns is None:
                due_s = max(due_s + _FRAME_S, monotonic())  # a late frame is not caught up
                await asyncio.sleep(due_s - monotonic())
            else:
                await self._changed.wait()
                self._changed.clear()
            await self._tell_led()
            if self._stage is None or self._number - self._acknowledged >= _MOST_WAITING:
                continue
            at_ns, new = self._at_ns, self._new
            if live and at_ns is None:
                sections = new.make(self._stage, self._show, None)
            else:
                async with self._console.reading:  # files are read beside the pages that lead, one at a time
                    sections = await asyncio.to_thread(new.make, self._stage, self._show, at_ns)
            if sections and new is self._new:
                self._number += 1
                at = new.time_ns if at_ns is None else at_ns
                await self._socket.send_bytes(frame(self._number, at, sections))
