"""The drawable parts of a session: scenes of participants, soft surfaces, markers, pictures, numbers."""

from __future__ import annotations

import gzip
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from importlib.metadata import entry_points
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hub.participant import Params
from hub.participant.view import TISSUE_COLOURS, Rgb, Scene
from schemas.codec import decode
from schemas.errors import MessageError, TrocarError
from schemas.message import Message
from schemas.ros import CompressedImage
from schemas.scenario import Scenario
from schemas.soft_surface import SoftSurface, film_steps
from schemas.trocar_msgs import ShownMarkers, SoftBodyState, SurfaceChange, SurfaceFilm
from schemas.vectors import VectorCodec, has_vector
from webconsole.arrows import BondArrows, bond_arrows
from webconsole.bond_history import BondHistory
from webconsole.drag import DraggedTip, dragged_tips
from webconsole.exchanges import OfferedInstruments, offered_instruments
from webconsole.felt import felt_wrenches
from webconsole.followers import find_followers, find_pedals
from webconsole.frame import Section, SectionKind, change_content, film_content, node_content
from webconsole.gauges import GAUGES
from webconsole.markers import marker_content
from webconsole.packing import pack
from webconsole.source import Outlet, Value

__all__ = ["GROUP", "Stage"]

log = logging.getLogger(__name__)

GROUP = "trocar.scenes"
"""Entry-point group: kind of participant -> function from parameters to a scene."""
_FLESH: Rgb = (0.8, 0.38, 0.33)
"""Colour of a surface without a scene."""
_NOTE = 1000
"""Longest reason in a note, characters: enough for a remedy at the end."""
_MOST_NODES = 2**20
"""Nodes of a surface that a page takes."""
_GRID_M = 2.0**-16
"""Step of rounded vertices, m: 15 um are not seen, and trailing zeros compress."""


class Stage:
    """The contents of the pages of a session.

    A failed scene is left out, and `notes` says why: plots and pictures work without a scene.
    """

    def __init__(
        self, scenario: Scenario, outlets: Sequence[Outlet], params: Callable[[str], Params]
    ) -> None:
        """`params` returns the validated parameters of a participant, or raises an error to be noted."""
        self.notes: list[str] = []
        self.scenes: dict[str, Scene] = {}
        """Scenes by participant, where there is something to draw."""
        self._outlets = {one.name: one for one in outlets}
        colours = self._draw(scenario, params)
        signals = [one for one in outlets if one.port.variability == "signal"]
        self.surfaces = {name: colours.get(name, _FLESH) for name in _of_type(signals, SoftBodyState)}
        """Colour of each soft surface, by the outlet of the nodes."""
        changes = _of_type(outlets, SurfaceChange)
        self.changes = {
            name: change
            for name in self.surfaces
            if (change := f"{name.removesuffix('nodes')}surface") in changes
        }
        """Outlet of the changed surface, by the outlet of the nodes."""
        films = _of_type(outlets, SurfaceFilm)
        self.films = {
            name: film for name in self.changes if (film := f"{name.removesuffix('nodes')}film") in films
        }
        """Outlet of the liquid on the surface, by the outlet of the nodes."""
        self.markers = _of_type(outlets, ShownMarkers)
        self.pictures = _of_type(outlets, CompressedImage)
        self.numbers = {one.name: VectorCodec(one.port) for one in signals if has_vector(one.port.type)}
        """The numeric outlets."""
        self.smokes = {
            name: smoke
            for name in self.surfaces
            if (smoke := f"{name.removesuffix('nodes')}smoke") in self.numbers
        }
        """Outlet of the smoke of the surface, by the outlet of the nodes."""
        self.gauges = {one.name: GAUGES[one.port.type] for one in signals if one.port.type in GAUGES}
        """The plottable outlets of the hub."""
        drawn = {name for participant in self.scenes for name in self.inputs(participant)}
        self._codecs = {name: codec for name, codec in self.numbers.items() if name in drawn}
        self.arrows = bond_arrows(scenario, self.numbers)
        self.histories = {bond.name: BondHistory(bond.name) for bond in self.arrows if bond.at_one_point}
        """Live values of each bond with a single point, by name."""
        self.felt = felt_wrenches(scenario, self.numbers)
        """Outlets of the wrenches on the moved instruments, by device led from pages."""
        self.followers = find_followers(scenario, self._outlets)
        """Controllers that follow a device led from pages, by device."""
        of_followers = (name for found in self.followers.values() for one in found for name in one.outlets)
        self.dragged, self.undragged = _dragged_tips(scenario, params)
        self.pedals = find_pedals(self.followers, self._outlets)
        """Buttons of each device that do something beside moving arm and jaw."""
        self.instruments = _offered_instruments(scenario, params)
        self.room = _room_view(scenario, params)
        of_hands = (name for names in self.felt.values() for name in names)
        of_arrows = (name for bond in self.arrows for name in bond)
        self.shown = frozenset(
            (
                *self._codecs,
                *self.surfaces,
                *self.changes.values(),
                *self.films.values(),
                *self.smokes.values(),
                *self.markers,
                *of_arrows,
                *of_hands,
                *of_followers,
            )
        )
        """The outlets needed for the scene itself."""

    def _draw(self, scenario: Scenario, params: Callable[[str], Params]) -> dict[str, Rgb]:
        """Make the scenes, and return the colours of their surfaces by outlet."""
        colours: dict[str, Rgb] = {}
        for participant, spec in scenario.participants.items():
            scene = self._scene(participant, spec.kind, params)
            if scene is not None:
                colours |= {f"{participant}.{port}": rgb for port, rgb in scene.surfaces.items()}
                if scene.bodies:
                    self.scenes[participant] = scene
        return colours

    def _scene(self, participant: str, kind: str, params: Callable[[str], Params]) -> Scene | None:
        for entry in entry_points(group=GROUP, name=kind):
            try:
                make: Callable[[Params], Scene] = entry.load()
                return make(params(participant))
            except Exception as error:  # noqa: BLE001  # a plug-in may raise anything; the page says what
                self.notes.append(
                    f"'{participant}' (kind {kind}) cannot be drawn: {type(error).__name__}:"
                    f" {' '.join(str(error).split())[:_NOTE]}"
                )
                log.warning("%s", self.notes[-1])
        return None

    def poses(self, participant: str, values: Mapping[str, Value]) -> NDArray[np.float32]:
        """Return the poses of a participant's bodies, shape (bodies, 7), for the newest values by outlet.

        Raises MessageError for an invalid value.
        """
        scene = self.scenes[participant]
        return scene.poses(
            {
                port: self._codecs[name].decode(values[name].payload)
                for port in scene.inputs
                if (name := f"{participant}.{port}") in self._codecs
            }
        )

    def inputs(self, participant: str) -> tuple[str, ...]:
        """Return the outlets needed for the poses of a participant."""
        return tuple(f"{participant}.{port}" for port in self.scenes[participant].inputs)

    def section(self, name: str, value: Value) -> Section:
        """Return the section of an outlet of a surface, markers or a picture."""
        if name in self.surfaces:
            nodes = decode(SoftBodyState, value.payload).nodes_m
            content = node_content(nodes) if nodes.size else b""
            return Section(SectionKind.NODES, [*self.surfaces].index(name), content)
        if name in self.markers:
            content = marker_content(decode(ShownMarkers, value.payload))
            return Section(SectionKind.MARKERS, self.markers.index(name), content)
        picture = decode(CompressedImage, value.payload).data.tobytes()
        return Section(SectionKind.PICTURE, self.pictures.index(name), picture)

    def surface(self, name: str, first: SoftSurface) -> Section:
        """Return the triangles of a soft surface at time 0."""
        return Section(SectionKind.SURFACE, [*self.surfaces].index(name), first.faces.astype("<u4").tobytes())

    def change(self, name: str, first: SoftSurface, value: Value) -> Section:
        """Return the difference of a soft surface from time 0; raises MessageError if it does not fit."""
        change = decode(SurfaceChange, value.payload)
        first.changed(change)
        return Section(SectionKind.CHANGE, [*self.surfaces].index(name), change_content(change))

    def film(self, name: str, value: Value) -> Section:
        """Return the liquid on a soft surface; raises MessageError if it is not valid."""
        film = decode(SurfaceFilm, value.payload)
        film_steps(film, _MOST_NODES)
        return Section(SectionKind.FILM, [*self.surfaces].index(name), film_content(film))

    def smoke(self, name: str, value: Value) -> Section:
        """Return the smoke of a soft surface, g/s; raises MessageError if it is not valid."""
        rate = self.numbers[self.smokes[name]].decode(value.payload)[:1]
        return Section(SectionKind.SMOKE, [*self.surfaces].index(name), rate.astype("<f4").tobytes())

    def is_numeric(self, name: str) -> bool:
        """Return whether an outlet can be plotted."""
        return name in self.numbers or name in self.gauges

    def sample(self, index: int, name: str, value: Value) -> Section:
        """Return time (s) and numbers of a numeric outlet; raises MessageError if invalid."""
        gauge = self.gauges.get(name)
        numbers = self.numbers[name].decode(value.payload) if gauge is None else gauge.read(value.payload)
        row = np.concatenate([[value.time_ns / 1e9], numbers])
        return Section(SectionKind.SAMPLE, index, row.astype("<f8").tobytes())

    def keep(self, name: str, value: Value) -> None:
        """Keep a live value of a bond for force against depth; one that cannot be read is left out."""
        for bond in self.arrows:
            if bond.at_one_point and name in bond:
                history, time_s = self.histories[bond.name], value.time_ns / 1e9
                add = history.add_place if name == bond.place else history.add_force
                with suppress(MessageError):  # the arrow of this bond says it
                    add(time_s, self.numbers[name].decode(value.payload))

    def arrow(self, bond: BondArrows, place: Value, force: Value) -> Section:
        """Return the arrows of a bond; raises MessageError if a value is not valid."""
        placed = self.numbers[bond.place].decode(place.payload)
        pushed = self.numbers[bond.force].decode(force.payload)
        rows = bond.rows(placed, pushed)
        return Section(SectionKind.ARROWS, self.arrows.index(bond), rows.astype("<f4").tobytes())

    def force(self, device: str, values: Mapping[str, Value]) -> Section:
        """Return the force on the instruments moved by a device; raises MessageError if invalid."""
        forces = [self.numbers[name].decode(value.payload)[:3] for name, value in values.items()]
        norm = np.linalg.norm(np.sum(forces, axis=0))
        return Section(SectionKind.FELT, [*self.felt].index(device), norm.astype("<f4").tobytes())

    def describe(self) -> dict[str, Any]:
        """Return the description for a page before the first frame, ready for JSON."""
        return {
            "scenes": [*self.scenes],
            "surfaces": [
                {"name": name, "colours": [rgb, *TISSUE_COLOURS.values()]}
                for name, rgb in self.surfaces.items()
            ],
            "pictures": list(self.pictures),
            "felt": list(self.felt),
            "dragged": [tip._asdict() for tip in self.dragged],
            "undragged": self.undragged,
            "instruments": [one._asdict() for one in self.instruments],
            "pedals": self.pedals,
            "room": self.room,
            "numbers": [
                {
                    "name": name,
                    "columns": _columns(codec),
                    "unit": codec.port.unit,
                    "type": codec.port.type,
                    "frame": codec.port.frame,
                    "text": codec.port.description,
                    "live": self._outlets[name].live,
                }
                for name, codec in self.numbers.items()
            ]
            + [
                {
                    "name": name,
                    "columns": gauge.columns,
                    "units": gauge.units,
                    "unit": "",
                    "type": self._outlets[name].port.type,
                    "frame": "",
                    "text": gauge.text,
                    "live": True,
                }
                for name, gauge in self.gauges.items()
            ],
            "bonds": [{"name": bond.name, "one": bond.at_one_point} for bond in self.arrows],
            "notes": self.notes,
        }

    @cached_property
    def packed_geometry(self) -> bytes:
        """The geometry, compressed by gzip."""
        return gzip.compress(self.geometry, 5, mtime=0)

    @cached_property
    def geometry(self) -> bytes:
        """The scenes as loaded once by a page (`pack`).

        In the JSON, `at` is where in the numbers, in bytes, and `count` how many.
        """
        blob, described = bytearray(), list[dict[str, Any]]()
        for participant, scene in self.scenes.items():
            described.append(
                {
                    "participant": participant,
                    "bodies": list(scene.bodies),
                    "parts": list(_parts(scene, blob)),
                    "frames": [
                        {"name": one.name, "body": one.body, "pose": list(one.pose)} for one in scene.frames
                    ],
                    "cameras": [
                        {
                            "name": one.name,
                            "body": one.body,
                            "pose": list(one.pose),
                            "fieldOfView": one.field_of_view,
                            "baseline": one.baseline,
                        }
                        for one in scene.cameras
                    ],
                }
            )
        return pack(described, blob)


def _dragged_tips(
    scenario: Scenario, params: Callable[[str], Params]
) -> tuple[tuple[DraggedTip, ...], tuple[str, ...]]:
    try:
        return dragged_tips(scenario, params)
    except TrocarError as error:
        return (), (str(error),)


def _offered_instruments(scenario: Scenario, params: Callable[[str], Params]) -> list[OfferedInstruments]:
    try:
        return offered_instruments(scenario, params)
    except TrocarError as error:
        log.warning("no exchange of instruments is offered: %s", error)
        return []


def _room_view(scenario: Scenario, params: Callable[[str], Params]) -> dict[str, Any] | None:
    """Return position and target (m, in the world) of the scenario's camera in the room; None without one."""
    for name, spec in scenario.participants.items():
        if spec.kind == "endoscope" and spec.params.get("view") is not None:
            try:
                return params(name).model_dump(include={"view"})["view"]
            except TrocarError as error:
                log.warning("the camera in the room is not offered: %s", error)
    return None


def _of_type(outlets: Iterable[Outlet], message: type[Message]) -> tuple[str, ...]:
    """Return the names of the outlets with messages of a type."""
    return tuple(one.name for one in outlets if one.port.type == message.ros_type)


def _parts(scene: Scene, blob: bytearray) -> Iterator[dict[str, Any]]:
    for part in scene.parts:
        row: dict[str, Any] = {"body": part.body, "colour": list(part.colour), "coat": part.coat}
        vertices = np.round(part.vertices / _GRID_M) * _GRID_M
        for key, array in (("vertices", vertices.astype("<f4")), ("faces", part.faces.astype("<u4"))):
            row[key] = {"at": len(blob), "count": array.size}
            blob += array.tobytes()
        yield row


def _columns(codec: VectorCodec) -> list[str]:
    """Return the name of each number: `position.x`, `position.yaw`, `data.0`; a single number has ''."""
    names = [f"{i}" for i in range(codec.size)]
    for field, block in codec.fields.items():
        if "." in field and block.stop - block.start == 1 and field.count(".") == 1:
            names[block.start] = field
    joints = codec.port.names
    for i, field in enumerate(codec.port.fields if joints else ()):
        for j, joint in enumerate(joints):
            names[i * len(joints) + j] = f"{field}.{joint}"
    return [""] if codec.size == 1 else names
