"""The sections of the next frame of a page: the changes since the last frame."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import partial
from time import monotonic_ns

from hub.participant.token_bucket import TokenBucket
from schemas.errors import TrocarError
from webconsole.arrows import BondArrows
from webconsole.commands import Show
from webconsole.console import Console
from webconsole.frame import Section, SectionKind
from webconsole.source import Value
from webconsole.stage import Stage

__all__ = ["NewSections"]

_PICTURES_PER_S = 25.0
"""Rate of each eye, at most: with 14 kB each, scene and organ, a page gets less than 1 MB/s."""

_Made = tuple[str, Callable[[], Iterable[Section]]]
"""The outlet, bond or participant of a section, and the function to make the section."""


class NewSections:
    """Makes sections of values new to a page; a damaged value costs its own section alone.

    Args:
        console: The source of the values.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._at_ns: int | None = None
        self._sent: dict[str, Value] = {}
        self._surfaces: set[str] = set()
        self._pictures = TokenBucket(_PICTURES_PER_S, 2.0)
        self.problems: dict[str, str] = {}
        """The first error of each outlet, bond or participant."""

    def send_all(self) -> None:
        """Count nothing as sent: the page has only now loaded the scene."""
        self._sent, self._surfaces = {}, set()

    @property
    def time_ns(self) -> int:
        """Simulated time of the newest value sent."""
        return max((value.time_ns for value in self._sent.values()), default=0)

    def make(self, stage: Stage, show: Show, at_ns: int | None) -> list[Section]:
        """Return the new sections at a simulated time; None: now."""
        self._at_ns = at_ns
        found: list[Section] = []
        for name, make in self._all(stage, show):
            try:
                found += make()
            except TrocarError as error:
                self.problems.setdefault(name, f"{name}: {error}")
        return found

    def _all(self, stage: Stage, show: Show) -> Iterator[_Made]:
        for participant in stage.scenes:
            yield participant, partial(self._poses, stage, participant)
        for name in stage.surfaces:
            yield name, partial(self._surface, stage, name)
        for bond in stage.arrows:
            yield bond.name, partial(self._force_arrows, stage, bond)
        for device in stage.felt:
            yield device, partial(self._force, stage, device)
        for name in stage.markers:
            yield name, partial(self._markers, stage, name)
        if show.pictures and (self._at_ns is not None or self._may_send(stage.pictures)):
            for name in stage.pictures:
                yield name, partial(self._picture, stage, name)
        for index, name in enumerate(show.numbers):
            if stage.is_numeric(name):
                yield name, partial(self._sample, stage, index, name)

    def _poses(self, stage: Stage, participant: str) -> Iterator[Section]:
        values = {name: value for name in stage.inputs(participant) if (value := self._newest(name))}
        if values and self._are_new(values):
            yield self._console.poses(stage, participant, values)

    def _surface(self, stage: Stage, name: str) -> Iterator[Section]:
        first = self._console.first_surface(name)
        if first is None:
            return
        if name not in self._surfaces:
            self._surfaces.add(name)
            yield stage.surface(name, first)
        if (outlet := stage.changes.get(name)) and (change := self._newest(outlet)):
            before, self._sent[outlet] = self._sent.get(outlet), change
            if before is None or before.payload != change.payload:
                yield self._console.change(stage, name, first, change)
        if (outlet := stage.films.get(name)) and (film := self._newest(outlet)):
            before, self._sent[outlet] = self._sent.get(outlet), film
            section = self._console.film(stage, name, film)
            if before is None or self._console.film(stage, name, before) != section:
                yield section
        yield from self._changed_section(stage, name)
        smoke = self._newest(stage.smokes[name]) if name in stage.smokes else None
        if smoke is not None and self._are_new({stage.smokes[name]: smoke}, "smoke "):
            yield stage.smoke(name, smoke)

    def _force_arrows(self, stage: Stage, bond: BondArrows) -> Iterator[Section]:
        place, force = self._newest(bond.place), self._newest(bond.force)
        if place and force and self._are_new({bond.place: place, bond.force: force}, "arrows "):
            yield stage.arrow(bond, place, force)

    def _force(self, stage: Stage, device: str) -> Iterator[Section]:
        values = {name: value for name in stage.felt[device] if (value := self._newest(name))}
        if values and self._are_new(values, "felt "):
            yield stage.force(device, values)

    def _markers(self, stage: Stage, name: str) -> Iterator[Section]:
        """Yield changed markers: most are published again without a change."""
        value, before = self._newest(name), self._sent.get(name)
        if value is not None:
            self._sent[name] = value
            if before is None or before.payload != value.payload:
                yield self._console.section(stage, name, value)

    def _may_send(self, pictures: Iterable[str]) -> bool:
        """Return whether there are new pictures allowed for the page; both eyes go together."""
        for name in pictures:
            with suppress(TrocarError):  # it is a problem of its own section
                if self._newest(name) is not self._sent.get(name):
                    return self._pictures.spend(monotonic_ns())
        return False

    def _changed_section(self, stage: Stage, name: str) -> Iterator[Section]:
        value = self._newest(name)
        if value is not None and self._are_new({name: value}):
            yield self._console.section(stage, name, value)

    def _picture(self, stage: Stage, name: str) -> Iterator[Section]:
        """Yield a new picture, and an empty one for an instant before the first picture."""
        if self._newest(name) is None and self._sent.pop(name, None) is not None:
            yield Section(SectionKind.PICTURE, stage.pictures.index(name), b"")
        else:
            yield from self._changed_section(stage, name)

    def _sample(self, stage: Stage, index: int, name: str) -> Iterator[Section]:
        value = self._newest(name)
        if value is not None and self._are_new({name: value}):
            yield stage.sample(index, name, value)

    def _newest(self, name: str) -> Value | None:
        return self._console.source.newest(name, self._at_ns)

    def _are_new(self, values: dict[str, Value], role: str = "") -> bool:
        """Return whether any value was not sent before in this role, and count all as sent."""
        new = any(self._sent.get(role + name) != value for name, value in values.items())
        if new:
            self._sent.update({role + name: value for name, value in values.items()})
        return new
