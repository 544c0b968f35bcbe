from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from schemas.errors import MessageError
from schemas.ros import Header
from schemas.soft_surface import FaceKind, SoftSurface, film_steps
from schemas.trocar_msgs import SoftBodyState, SurfaceChange, SurfaceFilm

FIRST = SoftBodyState(
    header=Header(),
    body="liver",
    nodes_m=np.zeros(12, np.float32),
    triangles=np.array([0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2], np.uint32),
)


def change(**fields: Any) -> SurfaceChange:
    whole: dict[str, Any] = {
        "slots": [1, 4],
        "faces": [0, 1, 4, -1, -1, -1],
        "kinds": [FaceKind.CUT, FaceKind.OUTSIDE],
        "origins": [3],
    }
    return SurfaceChange(header=Header(), body="liver", version=1, **(whole | fields))


def test_a_change_replaces_and_appends() -> None:
    first = SoftSurface.of_first(FIRST)
    changed = first.changed(change())
    assert changed.faces.tolist() == [[0, 2, 1], [0, 1, 4], [1, 2, 3], [0, 3, 2], [-1, -1, -1]]
    assert changed.kinds.tolist() == [0, 1, 0, 0, 0]
    assert changed.origins.tolist() == [0, 1, 2, 3, 3]
    assert first.faces[1].tolist() == [0, 1, 3]


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"slots": [1]}, "1 slots, 2 kinds, 6 face nodes"),
        ({"kinds": [1, 1, 1]}, "3 kinds"),
        ({"faces": [0, 1, 2, 3]}, "4 face nodes"),
        ({"slots": [4, 1]}, "do not ascend"),
        ({"slots": [1, 1]}, "do not ascend"),
        ({"slots": [1, 5]}, "1 appended faces up to slot 5 after 4"),
        ({"slots": [1, 2**32 - 1]}, "appended faces up to slot 4294967295"),
        ({"kinds": [1, 4]}, "kind 4, allowed are 0 to 3"),
        ({"faces": [0, 1, 5, -1, -1, -1]}, "node outside 0 to 4"),
        ({"faces": [0, 1, -1, -1, -1, -1]}, "node outside 0 to 4"),
        ({"faces": [0, 1, -2, -1, -1, -1]}, "node outside 0 to 4"),
        ({"faces": [0, 1, 2**31 - 1, -1, -1, -1]}, "node outside 0 to 4"),
        ({"origins": [4]}, "a copy of node 4, allowed are 0 to 3"),
    ],
)
def test_a_strangers_change_is_refused(fields: dict[str, Any], problem: str) -> None:
    with pytest.raises(MessageError, match=f"changed surface of 'liver', version 1: .*{problem}"):
        SoftSurface.of_first(FIRST).changed(change(**fields))


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"triangles": [0, 1]}, "2 numbers of triangles, 12 of nodes, expected three"),
        ({"triangles": []}, "0 numbers of triangles"),
        ({"nodes_m": [0.0] * 11}, "11 of nodes"),
        ({"triangles": [0, 1, 4]}, "three node indices each, below 4"),
        ({"nodes_m": []}, "three node indices each, below 0"),
    ],
)
def test_a_strangers_first_state_is_refused(fields: dict[str, Any], problem: str) -> None:
    with pytest.raises(MessageError, match=problem):
        SoftSurface.of_first(SoftBodyState.model_validate(FIRST.model_dump() | fields))


def film(**fields: Any) -> SurfaceFilm:
    return SurfaceFilm(header=Header(), body="liver", liquid="blood", **fields)


def test_a_film_is_as_thick_as_its_message_says() -> None:
    assert film_steps(film(nodes=[1, 3], thickness=[7, 255]), 5).tolist() == [0, 7, 0, 255, 0]
    assert film_steps(film(), 2).tolist() == [0, 0]


@pytest.mark.parametrize(
    ("fields", "problem"),
    [
        ({"nodes": [1, 3], "thickness": [7]}, "expected as many"),
        ({"nodes": [3, 1], "thickness": [7, 7]}, "ascending"),
        ({"nodes": [1, 1], "thickness": [7, 7]}, "ascending"),
        ({"nodes": [5], "thickness": [7]}, "allowed are 0 to 4"),
    ],
)
def test_a_film_that_does_not_fit_is_refused(fields: dict[str, Any], problem: str) -> None:
    with pytest.raises(MessageError, match=problem):
        film_steps(film(**fields), 5)
