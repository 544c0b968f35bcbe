"""Harm to organs: perforation, burns with their distances, injuries of structures to be spared, avulsions."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from hub.participant import Record, array, integer
from schemas.trocar_msgs import ScoreValue, TissueEvent
from schemas.vectors import Vector
from tasks.cholecystectomy.organs import (
    BOWEL,
    COMMON_DUCT,
    DUCT,
    GALLBLADDER,
    HEPATIC_ARTERY,
    JOINTS,
    LIVER,
    ORGANS,
    SPARED,
    TARGETS,
)
from tasks.cholecystectomy.tissue_seen import OrganSeen, TissueSeen
from tasks.cholecystectomy.watch import Watch, value_or_reason
from tasks.events import Event, EventKind

__all__ = ["BURN_ORGANS", "Harm"]

BURN_ORGANS = (LIVER, DUCT, COMMON_DUCT, HEPATIC_ARTERY, BOWEL)
"""Organs whose burns and temperatures are on the card."""
_UNKNOWN = -1.0
_HURTS = ("cut", "torn", "burnt")
_NO_ORGAN = "no such organ: connect or record tissue/{}/events"
_NO_HEAT = "no temperature: connect or record tissue/{}/hottest, which organs have beside a probe with energy"


class HarmState(Record):
    """Sums over the trial."""

    burnt = array(len(ORGANS))
    """Volume burnt in each organ, m^3."""
    hottest = array(len(ORGANS))
    """Highest temperature of each organ, degrees C."""
    torn = array(len(ORGANS))
    """Area torn in each organ, m^2."""
    nearest = array(len(BURN_ORGANS))
    """Least distance of burns in other organs from each organ, m; -1: none."""
    perforations = integer()
    avulsions = array(len(JOINTS))
    """1 for each joint of which a part has come off."""


class Harm(Watch[HarmState]):
    """Burns, tears, perforations and avulsions; also makes the events about them."""

    def __init__(self, seen: TissueSeen) -> None:
        self.state = HarmState()
        self.state.nearest[:] = _UNKNOWN
        self._seen = seen

    def observe(self, arm_of: Callable[[str], int]) -> Iterator[Event]:
        """Add burns, tears and temperatures; yield the events of an instant."""
        self._add()
        for index, name in enumerate(ORGANS):
            organ = self._seen.organs[name]
            for event in organ.events:
                yield from self._hurt(index, organ, event, arm_of(event.instrument))
        for index, (joint, tube) in enumerate(JOINTS.items()):
            if not self.state.avulsions[index] and self._seen.has_parted(joint):
                self.state.avulsions[index] = 1.0
                area = self._seen.freed[joint]
                yield Event("tube torn", place=ORGANS.index(tube), value=area, unit="m^2")

    def _hurt(self, index: int, organ: OrganSeen, event: TissueEvent, arm: int) -> Iterator[Event]:
        name, kind, found = organ.name, event.kind, list[EventKind]()
        if name in SPARED and kind in _HURTS:
            found.append("wrong structure hurt")
        if kind == "clipped" and name not in TARGETS:
            found.append("wrong structure clipped")
        if name == GALLBLADDER and (kind == "leaking" or (kind in _HURTS[:2] and not organ.has_liquid)):
            self.state.perforations += 1
            found.append("gallbladder perforated")
        if name in TARGETS and kind == "burnt":
            found.append("target burnt")
        for one in found:
            yield Event(one, arm=arm, place=index, value=event.size, unit=event.unit)

    def _add(self) -> None:
        state = self.state
        for index, name in enumerate(ORGANS):
            organ = self._seen.organs[name]
            state.hottest[index] = max(state.hottest[index], organ.hottest)
            for event in organ.events:
                if event.kind == "burnt":
                    state.burnt[index] += event.size
                    self._measure(name, np.array([event.position.x, event.position.y, event.position.z]))
                elif event.kind == "torn":
                    state.torn[index] += event.size

    def _measure(self, burnt: str, place: Vector) -> None:
        """Take the distances of a burn from organs other than the burnt one."""
        for k, name in enumerate(BURN_ORGANS):
            organ = self._seen.organs[name]
            if name == burnt:
                continue
            if organ.tube is not None:
                distance = organ.tube.place(place).distance
            elif len(organ.nodes):
                distance = float(np.linalg.norm(organ.nodes - place, axis=1).min())
            else:
                continue
            if np.isfinite(distance) and not 0.0 <= self.state.nearest[k] <= distance:
                self.state.nearest[k] = distance

    def values(self) -> Iterator[ScoreValue]:
        """Yield volumes, temperatures, distances, areas and counts."""
        state = self.state
        for k, name in enumerate(BURN_ORGANS):
            yield from self._burns(k, name)
        for name in (GALLBLADDER, *TARGETS, LIVER):
            index = ORGANS.index(name)
            reason = "" if self._seen.organs[name].is_known else _NO_ORGAN.format(name)
            yield value_or_reason(f"{name}/torn", float(state.torn[index]), "m^2", reason)
        gallbladder = self._seen.organs[GALLBLADDER].is_known
        reason = "" if gallbladder else _NO_ORGAN.format(GALLBLADDER)
        yield value_or_reason("perforations", float(state.perforations), "", reason)
        joints = bool(self._seen.freed.keys() & JOINTS.keys())
        reason = "" if joints else "the tubes are not attached to other organs in this scene"
        yield value_or_reason("avulsions", float(state.avulsions.sum()), "", reason)

    def _burns(self, k: int, name: str) -> Iterator[ScoreValue]:
        organ, index = self._seen.organs[name], ORGANS.index(name)
        reason = "" if organ.is_known else _NO_ORGAN.format(name)
        heat = "" if organ.has_heat else _NO_HEAT.format(name)
        yield value_or_reason(f"{name}/burnt", float(self.state.burnt[index]), "m^3", reason)
        yield value_or_reason(f"{name}/hottest", float(self.state.hottest[index]), "degC", heat)
        distance = float(self.state.nearest[k])
        why = reason or ("" if distance >= 0.0 else "nothing beside it was burnt")
        yield value_or_reason(f"{name}/burn_distance", distance, "m", why)
