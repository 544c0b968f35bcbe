"""Events of a tube: clips and partings, each with its place along the line."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engines.fem.blood.clips import Clips, Lost
from engines.fem.blood.lumen import Lumen, Opening
from engines.fem.blood.partings import Parting
from engines.fem.organ import Organ
from hub.participant import event_out, signal_out
from schemas.ports import Port
from schemas.ros import Header, Point, Time
from schemas.trocar_msgs import TubeClips, TubeEvent
from schemas.vectors import Vector

__all__ = ["TubeEvents", "tube_ports"]

_SAME = 2
"""Distance of partings, in rings, up to which they are the same."""


def tube_ports(organ: str, period_ns: int) -> tuple[Port, ...]:
    """Return the ports of clips and events of an organ with a lumen."""
    clips, happened = "clips since time 0, with their place", "clips and partings, with their place"
    return (
        signal_out(f"{organ}/clips", TubeClips, clips, frame="world", period_ns=period_ns),
        event_out(f"{organ}/tube", TubeEvent, happened, frame="world"),
    )


class TubeEvents:
    """Events of the present step, and the partings that have been said."""

    def __init__(self, organ: Organ, lumen: Lumen, clips: Clips) -> None:
        self._organ, self._lumen, self._clips = organ, lumen, clips
        self._said: list[TubeEvent] = []
        self.parted: NDArray[np.int64] = np.zeros(0, np.int64)
        """Rings of the partings that have been said."""
        self.open: NDArray[np.int64] = np.zeros(0, np.int64)
        """Rings at which an opening of the wall has been said."""

    def say_clipped(
        self, number: int, ring: int, place: Vector, instrument: str, others: Sequence[str]
    ) -> None:
        """Say that a clip closed. `place`: m, in `world`, shape (3,); `others`: organs beside."""
        self._say("clipped", place, ring, instrument, clip=number, others=list(others))

    def say_slipped(
        self, kind: str, ring: int, place: Vector, instrument: str, others: Sequence[str], cause: str
    ) -> None:
        """Say that a clip slipped, and why."""
        self._say(kind, place, ring, instrument, others=list(others), cause=cause)

    def say_lost(self, lost: Lost) -> None:
        """Say that a clip was pulled off."""
        self._say("clip pulled off", lost.place, lost.ring, lost.instrument, clip=lost.number)

    def watch(self) -> None:
        """Say where the wall has opened, and where the tube has parted, since it was watched last."""
        for opening in self._lumen.openings:
            rings = np.arange(opening.first, opening.last + 1)
            is_known = self.open.size and int(np.abs(self.open[:, None] - rings).min()) <= _SAME
            self.open = np.union1d(self.open, rings)
            if not is_known and opening.share < 1.0:
                self._say_perforated(opening)
        partings = self._lumen.partings
        for k, parting in enumerate(partings):
            if not self.parted.size or int(np.abs(self.parted - parting.ring).min()) > _SAME:
                self.parted = np.append(self.parted, parting.ring)
                self._say_parted(partings, k)

    def _say_perforated(self, opening: Opening) -> None:
        cause, instrument = self._organ.events.latest
        ring = (opening.first + opening.last) // 2
        faces = self._organ.surface.faces[opening.slots]
        nodes = self._organ.nodes
        place: Vector = nodes[faces].mean(axis=(0, 1)) if len(faces) else self._lumen.middles[ring]
        self._organ.events.say("perforated", instrument, place, self._lumen.gape(opening, nodes), "m^2")
        self._say("perforated", place, ring, instrument, cause=cause)

    @property
    def state(self) -> tuple[NDArray[np.generic], ...]:
        """Arrays that the next step depends on."""
        return self.parted, self.open, self._lumen.left

    def restore(self, *state: NDArray[np.generic]) -> None:
        """Go back to a saved `state`."""
        self.parted, self.open = (part.astype(np.int64) for part in state[:2])
        self._lumen.left[:] = state[2]

    def _say_parted(self, partings: Sequence[Parting], k: int) -> None:
        cause, instrument = self._organ.events.latest
        parting = partings[k]
        before = partings[k - 1].ring if k else -1
        after = partings[k + 1].ring if k + 1 < len(partings) else len(self._lumen.along)
        rings = [clip.ring for clip in self._clips.closed if clip.is_on]
        left = sum(before < ring <= parting.ring for ring in rings)
        right = sum(parting.ring < ring <= after for ring in rings)
        place: Vector = self._lumen.middles[parting.ring : parting.ring + 2].mean(axis=0)
        counts = {"left_clips": left, "right_clips": right}
        self._say("parted", place, parting.ring, instrument, cause=cause, along_m=parting.along, **counts)

    def _say(self, kind: str, place: Vector, ring: int, instrument: str, **more: object) -> None:
        x, y, z = place.tolist()
        along = {"along_m": float(self._lumen.along[ring])}
        event = TubeEvent(header=Header(frame_id="world"), kind=kind, body=self._organ.name)
        said = {"instrument": instrument, "position": Point(x=x, y=y, z=z)} | along | more
        self._said.append(event.model_copy(update=said))

    def finish(self, t: int) -> tuple[TubeEvent, ...]:
        """End the step at `t` ns; return its events."""
        if not self._said:
            return ()
        header = Header(stamp=Time.from_ns(t), frame_id="world")
        found = tuple(event.model_copy(update={"header": header}) for event in self._said)
        self._said.clear()
        return found

    def clips(self, t: int) -> TubeClips:
        """Return all clips at `t` ns."""
        closed = self._clips.closed
        return TubeClips(
            header=Header(stamp=Time.from_ns(t), frame_id="world"),
            body=self._organ.name,
            numbers=np.array([clip.number for clip in closed], np.int32),
            along_m=self._lumen.along[[clip.ring for clip in closed]],
            on=np.array([clip.is_on for clip in closed], np.uint8),
            instruments=[clip.instrument for clip in closed],
        )
