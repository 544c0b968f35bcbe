"""Numbers of an Open-H episode: poses and set-points of the instruments, and truths of the scene.

Names are those of Open-H-Embodiment's dVRK data (JHU; open-h-embodiment/data-collection at 6af6fab,
scripts/conversion/dvrk_zarr_to_lerobot.py), of which the layouts `open-h-dvrk` of `robots.policies` consist.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from learning.datasets.columns import Columns
from robots.policies.actions import ACTIONS
from robots.policies.fields import Group
from robots.policies.states import state_groups
from schemas.codec import decode
from schemas.errors import MessageError, RecordingError
from schemas.trocar_msgs import SoftBodyState
from schemas.vectors import Vector, has_vector
from trocar import Recording

if TYPE_CHECKING:
    from learning.datasets.tips import Tips

__all__ = ["ARMS", "META", "action_columns", "meta_columns", "state_columns", "tools"]

ARMS = ("PSM1", "PSM2")
"""Arms of a row, in order: eight numbers each; PSM3 follows where a scene has it, which Open-H has not."""
META = "observation.meta."
_ABSENT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
"""Numbers of an arm that the scene does not have."""
_TISSUE = ("bullet", "fem", "suture-pad")
"""Kinds with truths of tissue and thread."""
_MOST = 4
"""Most numbers of a port for a truth of tissue: longer ones are meshes."""


def state_columns(tips: Tips) -> list[Columns]:
    """Return measured pose and jaw of each arm, eight numbers each."""
    return [
        _arm_columns(tips, arm, tips.measured, state_groups("open-h-dvrk", arm, tips.frame, ()))
        for arm in _arms_of(tips)
    ]


def action_columns(tips: Tips) -> list[Columns]:
    """Return set-points of pose and jaw of each arm, eight numbers each."""
    layout = ACTIONS["open-h-dvrk"]
    return [
        _arm_columns(tips, arm, tips.commanded, layout.groups(arm, tips.frame, ())) for arm in _arms_of(tips)
    ]


def _arms_of(tips: Tips) -> list[str]:
    """Return Open-H's two arms, then a third of the scene."""
    return [*ARMS, *(arm for arm in tips.instruments if arm not in ARMS)]


def _arm_columns(
    tips: Tips, arm: str, columns_of: Callable[[str], Columns], groups: Iterable[Group]
) -> Columns:
    """Return the numbers of an arm by their names in the data set; constant ones without the arm."""
    names = tuple(field.name for group in groups for field in group.fields)
    if arm in tips.instruments:
        columns = columns_of(arm)
        return Columns(columns.port, names, columns.times_ns, columns.values)
    return Columns("", names, np.array([0, 2**62], np.int64), np.repeat(_ABSENT[None], 2, axis=0))


def tools(tips: Tips) -> dict[str, str]:
    """Return the instrument of each arm, by feature."""
    return {f"{META}tool.{arm.lower()}": str(tips.arms[arm].instrument) for arm in tips.instruments}


def meta_columns(recording: Recording, tips: Tips) -> dict[str, Columns]:
    """Return the truths of the scene by feature: forces, objects, tissue, thread."""
    found: dict[str, Columns] = {}
    for arm in tips.instruments:
        if (force := _force(recording, tips, arm)) is not None:
            found[f"{META}force_torque.{arm.lower()}"] = force
    kinds = {name: spec.kind for name, spec in recording.scenario().participants.items()}
    for port in recording.ports:
        participant, _, name = port.partition(".")
        if not len(recording[port]):
            continue
        if kinds.get(participant) == "mujoco" and name.endswith(("/pose", "/held_by")):
            thing, _, what = name.rpartition("/")
            found[f"{META}{'object' if what == 'pose' else 'holder'}.{thing}"] = _object(
                recording, tips, port
            )
        elif kinds.get(participant) in _TISSUE:
            found |= dict(_tissue(recording, tips, port, f"{META}tissue.{name.replace('/', '.')}"))
    return found


def _force(recording: Recording, tips: Tips, arm: str) -> Columns | None:
    """Return force (N) and torque (N m) on an instrument, by tissue and rigid parts, in the frame's axes."""
    wrenches = [
        recording[port]
        for port in recording.ports
        if port.partition(".")[2] in (f"{arm}/tip_wrench", f"{arm}/rigid_wrench") and len(recording[port])
    ]
    if not wrenches:
        return None
    times_ns = _times_ns(wrenches[0].time)
    total = np.zeros((len(times_ns), 6))
    for series in wrenches:
        newest = np.searchsorted(_times_ns(series.time), times_ns, side="right") - 1
        total += series.values[newest.clip(min=0)]
    turn = tips.turn(arm, times_ns)
    parts = [np.einsum("nij,nj->ni", turn, total[:, at : at + 3]) for at in (0, 3)]
    return Columns(wrenches[0].name, ("fx", "fy", "fz", "tx", "ty", "tz"), times_ns, np.hstack(parts))


def _object(recording: Recording, tips: Tips, port: str) -> Columns:
    series = recording[port]
    times_ns, values = _times_ns(series.time), series.values.reshape(len(series), -1)
    if port.endswith("/pose"):
        names = (*(f"position.{axis}" for axis in "xyz"), *(f"orientation.{axis}" for axis in "xyzw"))
        return Columns(port, names, times_ns, tips.from_world(values, times_ns))
    return Columns(port, ("arm",), times_ns, values)


def _tissue(recording: Recording, tips: Tips, port: str, key: str) -> Iterator[tuple[str, Columns]]:
    """Yield a port of tissue if its numbers are few, or the nodes of a thread."""
    series = recording[port]
    ros_type = recording.ports[port]
    if has_vector(ros_type):
        values = series.values.reshape(len(series), -1)
        if values.shape[1] <= _MOST and np.isfinite(values).all():
            yield key, Columns(port, tuple(series.columns), _times_ns(series.time), values)
    elif ros_type == SoftBodyState.ros_type and port.endswith("thread/nodes"):
        yield f"{META}thread", _nodes(recording, tips, port)


def _nodes(recording: Recording, tips: Tips, port: str) -> Columns:
    """Return the nodes of a thread: x, y, z of each, one after the other."""
    times: list[int] = []
    rows: list[Vector] = []
    for message in recording.messages(recording[port].topic):
        try:
            state = decode(SoftBodyState, message.payload)
        except MessageError as error:
            raise RecordingError(f"'{recording.file}': '{port}': {error}") from error
        times.append(message.time_ns)
        rows.append(state.nodes_m.astype(np.float64).reshape(-1, 3))
    if len({len(row) for row in rows}) != 1:
        raise RecordingError(f"'{recording.file}': '{port}' has another number of nodes over time")
    times_ns, nodes = np.array(times, np.int64), np.stack(rows)
    identity = np.broadcast_to(_ABSENT[3:7], (*nodes.shape[:2], 4))
    poses = np.concatenate([nodes, identity], axis=2)
    seen = np.stack([tips.from_world(poses[:, i], times_ns)[:, :3] for i in range(nodes.shape[1])], axis=1)
    names = tuple(f"node{i}.{axis}" for i in range(nodes.shape[1]) for axis in "xyz")
    return Columns(port, names, times_ns, seen.reshape(len(seen), -1))


def _times_ns(times: Vector) -> NDArray[np.int64]:
    return np.round(times * 1e9).astype(np.int64)
