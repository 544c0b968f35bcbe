"""Shared state of all pages of a server: the source, the drawable stage, and the pilots of devices."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hub.devices.network_link_control import NetworkLinkRequest
from hub.participant.appearance import RestBody
from hub.recording.bond_trace import Contact
from hub.transport.control_messages import Empty, StepRequest
from schemas.codec import decode
from schemas.errors import MessageError, ScenarioError
from schemas.soft_surface import SoftSurface
from schemas.trocar_msgs import ScoreCard, SoftBodyState
from webconsole.appearance import PageAppearance, find_appearance
from webconsole.changes import wrong_fields
from webconsole.commands import Control, Fork, Network, Pick, Say, Start, Tune
from webconsole.fork import fork_arguments, fork_modules
from webconsole.frame import Section, SectionKind, pose_content
from webconsole.guide import GuidedWork, guide_request
from webconsole.live import Live
from webconsole.log import card_of
from webconsole.pilot import Pilots
from webconsole.recorded import Recorded
from webconsole.source import Value
from webconsole.stage import Stage
from webconsole.start import start_arguments
from webconsole.started import Started

__all__ = ["Console"]

_VERBS = {"pause": "pause", "resume": "resume", "step": "step", "stop": "shutdown"}


class Console:
    """The pages' common ground.

    Args:
        source: Source of the values.
        pilots: Pilots of devices.
        started: Sessions started from pages, shared with other consoles; None: a separate collection.
    """

    def __init__(self, source: Live | Recorded, pilots: Pilots, started: Started | None = None) -> None:
        self.source, self.pilots = source, pilots
        self.started = started or Started()
        self.drawable: Callable[[], None] = lambda: None
        """Called in a thread when the stage of a session is complete, with nothing left to compute: to
        compile a model stops all threads for up to 0.1 s.
        """
        if isinstance(source, Live):
            source.left_out = self.started.pids
        self.reading = asyncio.Lock()
        """Held while a page reads an instant of the past."""
        self._stage: Stage | None = None
        self._generation = -1
        self._making = asyncio.Lock()
        self._wants: dict[object, frozenset[str]] = {}
        self._made: dict[str, tuple[Value, Section]] = {}
        self._firsts: dict[str, SoftSurface] = {}
        """Surfaces at time 0, by outlet of the nodes."""
        self._appearance: tuple[int, dict[str, bool], PageAppearance | None] | None = None
        """Generation, whether each soft body was known, and the appearance."""
        self._dressing = asyncio.Lock()

    async def stage(self) -> Stage | None:
        """Return the stage of the present session; None without a session."""
        async with self._making:
            scenario, generation = self.source.scenario, self.source.generation
            if scenario is None:
                return None
            if generation != self._generation:
                self._stage = stage = await asyncio.to_thread(
                    Stage, scenario, self.source.outlets, self.source.params
                )
                if isinstance(self.source, Live):
                    self.source.keep = stage.keep
                await asyncio.to_thread(lambda: stage.packed_geometry)
                self._generation, self._made, self._firsts = generation, {}, {}
                await asyncio.to_thread(self.drawable)
            return self._stage

    def show(self, source: Recorded) -> None:
        """Show a recording from now on; the pages of the session before load again."""
        self.source, self._stage, self._generation = source, None, -1
        self.pilots.keep([])

    def want(self, page: object, names: frozenset[str] | None) -> None:
        """Receive the outlets shown by a page; None: the page has gone."""
        if names is None:
            self._wants.pop(page, None)
        else:
            self._wants[page] = names
        guided = self.source.guided
        work = () if guided is None else (GuidedWork(guided).stage, GuidedWork(guided).status)
        self.source.want(frozenset(work).union(*self._wants.values()))

    def section(self, stage: Stage, name: str, value: Value) -> Section:
        """Return the section of a surface or a picture, made once for all pages."""
        held = self._made.get(name)
        if held is None or held[0] is not value:
            held = self._made[name] = value, stage.section(name, value)
        return held[1]

    def first_surface(self, name: str) -> SoftSurface | None:
        """Return a soft surface at time 0, read once; None if unknown. Raises MessageError if invalid."""
        if name not in self._firsts and (first := self.source.first(name)) is not None:
            state = decode(SoftBodyState, first.payload)
            if not state.triangles.size:
                return None
            self._firsts[name] = SoftSurface.of_first(state)
        return self._firsts.get(name)

    async def appearance(self) -> PageAppearance | None:
        """Return the appearance of the present session, with the soft bodies known by now; None: none."""
        stage, scenario = await self.stage(), self.source.scenario
        if stage is None or scenario is None:
            return None
        async with self._dressing:
            rests = {name: await asyncio.to_thread(self._rest, name) for name in stage.surfaces}
            known = {name: rest is not None for name, rest in rests.items()}
            if self._appearance is None or self._appearance[:2] != (self._generation, known):
                found = await asyncio.to_thread(find_appearance, scenario, self.source.params, rests)
                self._appearance = self._generation, known, found
            return self._appearance[2]

    def _rest(self, name: str) -> RestBody | None:
        """Return a soft body at time 0; None if unknown. Raises MessageError if invalid."""
        first, surface = self.source.first(name), self.first_surface(name)
        if first is None or surface is None:
            return None
        nodes = decode(SoftBodyState, first.payload).nodes_m.reshape(-1, 3)
        return RestBody(nodes, surface.faces.astype(np.uint32))

    def texture(self, name: str) -> bytes | None:
        """Return a texture of the present appearance by its hash; None: there is no such texture."""
        found = self._appearance and self._appearance[2]
        return found.textures.get(name) if found else None

    def change(self, stage: Stage, name: str, first: SoftSurface, value: Value) -> Section:
        """Return the section with the changes of a surface, made once for all pages."""
        held = self._made.get(stage.changes[name])
        if held is None or held[0].payload != value.payload:
            held = self._made[stage.changes[name]] = value, stage.change(name, first, value)
        return held[1]

    def film(self, stage: Stage, name: str, value: Value) -> Section:
        """Return the section with the liquid on a surface, made once for all pages."""
        held = self._made.get(stage.films[name])
        if held is None or held[0] is not value:
            held = self._made[stage.films[name]] = value, stage.film(name, value)
        return held[1]

    def poses(self, stage: Stage, participant: str, values: dict[str, Value]) -> Section:
        """Return the section with the poses of a participant's bodies, made once for all pages."""
        (value,) = [*values.values()][-1:]
        held = self._made.get(participant)
        if held is None or held[0] is not value:
            content = pose_content(stage.poses(participant, values))
            section = Section(SectionKind.POSES, [*stage.scenes].index(participant), content)
            held = self._made[participant] = value, section
        return held[1]

    async def control(self, order: Control) -> None:
        """Pause, resume, step or stop the session; raises MessageError or ConnectError."""
        live = self.live_source()
        request = StepRequest(steps=order.steps) if order.do == "step" else Empty()
        await asyncio.to_thread(live.ask, _VERBS[order.do], request, Empty)

    async def network(self, order: Network) -> None:
        """Change a device's network link; raises MessageError or ConnectError."""
        live = self.live_source()
        given: dict[str, Any] = order.model_dump(exclude={"do"}, exclude_none=True)
        whole_ns = {key: f"{given[key] * 1e9:.0f} ns" for key in ("delay", "jitter") if key in given}
        request = NetworkLinkRequest.model_validate(given | whole_ns)
        await asyncio.to_thread(live.change_link, request)

    async def tune(self, order: Tune) -> None:
        """Change a parameter of the running session; raises MessageError or ConnectError."""
        await asyncio.to_thread(self.live_source().tune, order)

    async def guide(self, order: Pick | Say) -> None:
        """Pass on a person's pick or word; raises MessageError or ConnectError."""
        live = self.live_source()
        await asyncio.to_thread(live.ask, "set", guide_request(live.guided, order), Empty)

    def guided_work(self) -> dict[str, Any] | None:
        """Return stage and words of the work that a person guides, ready for JSON; None without such work."""
        if self.source.guided is None:
            return None
        work = GuidedWork(self.source.guided)
        return work.as_json(*(self.source.newest(name, None) for name in (work.stage, work.status)))

    async def prepare(self) -> None:
        """Have processes ready for a session about to be started from here."""
        scenario = self.source.scenario if isinstance(self.source, Recorded) else None
        modules = ["hub.fork"] if scenario is None else fork_modules(scenario)
        await asyncio.to_thread(self.started.prepare, modules)

    async def fork(self, order: Fork) -> int:
        """Start a fork of the recording; return the session's number. Raises MessageError, ScenarioError."""
        recording = self.recorded_source().recording
        arguments = await asyncio.to_thread(fork_arguments, recording, order)
        title = f"fork of {recording.file.parent.name} at {order.time:g} s"
        return (await asyncio.to_thread(self.started.start, title, arguments, order.time)).number

    async def start(self, order: Start) -> dict[str, Any]:
        """Start an installed scenario and return the session's number, or the errors by field.

        Raises MessageError or ScenarioError for an error outside the fields.
        """
        try:
            arguments = await asyncio.to_thread(start_arguments, order, Path.cwd())
        except ScenarioError as error:
            if wrong := wrong_fields(error, order.changes):
                return {"wrong": wrong}
            raise
        return {"number": (await asyncio.to_thread(self.started.start, order.scenario, arguments)).number}

    def live_source(self) -> Live:
        """Return the running session's source; raises MessageError if this is a recording."""
        if not isinstance(self.source, Live):
            raise MessageError("this page shows a recording, which cannot be steered")
        return self.source

    def recorded_source(self) -> Recorded:
        """Return the recording's source; raises MessageError if this is a running session."""
        if not isinstance(self.source, Recorded):
            raise MessageError("this page shows a running session; its recording has a timeline")
        return self.source

    def led(self, page: object, stage: Stage | None) -> dict[str, dict[str, str]]:
        """Return how each device led by `page` follows it, and why an arm does not follow the device."""
        found: dict[str, dict[str, str]] = {}
        for device, obedience in self.pilots.obediences(page).items():
            found[device] = {"obedience": obedience}
            for follower in stage.followers.get(device, ()) if stage else ():
                values = {name: self.source.newest(name, None) for name in follower.outlets}
                with suppress(MessageError):  # a damaged value has its own line
                    if (why := follower.hindrance(values)) is not None:
                        found[device]["hindrance"] = why
        return found

    async def contacts(self, bond: str) -> list[Contact]:
        """Return the contacts of a bond with a single point; raises MessageError or RecordingError."""
        stage = await self.stage()
        found = next((one for one in (stage.arrows if stage else ()) if one.name == bond), None)
        if stage is None or found is None or not found.at_one_point:
            raise MessageError(f"no bond '{bond:.80}' acts at one point")
        if isinstance(self.source, Recorded):
            return await asyncio.to_thread(self.source.contacts, found)
        return stage.histories[bond].trace.contacts

    def card(self, time_ns: int | None) -> dict[str, Any] | None:
        """Return the newest score card at a simulated time, ready for JSON; None if there is none."""
        names = [one.name for one in self.source.outlets if one.port.type == ScoreCard.ros_type]
        card = self.source.newest(names[0], time_ns) if names else None
        return None if card is None else card_of(card)
