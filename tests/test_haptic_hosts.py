"""Hub, device host and servo process, each for itself, with a simulated hand behind the stand-in of HDAPI:
what the hand feels when the hub is killed.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pytest

from tests.devices.standins import build
from tests.devices.standins.hd import VARIABLE, HdWorld, Row
from tests.hub.authorities import free_endpoint
from tests.waiting import LIMIT_S

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

PATIENCE_S = LIMIT_S
HEIGHT = 0.0225
"""How far the table is below where the tip starts, m."""
SCENARIO = {
    "name": "table",
    "step": "4 ms",
    "pace": "realtime",
    "participants": {
        "stylus": {"kind": "touch", "host": "remote", "styluses": {"right": {}}},
        "teleop": {
            "kind": "teleoperation",
            "scale": 1.0,
            "engage": "held",
            "planes": [{"normal": [0, 0, 1], "distance": "-136 mm", "stiffness": "200 N/m"}],
        },
    },
    "connections": [
        "stylus.right/pose -> teleop.master",
        "stylus.right/buttons -> teleop.buttons",
        "teleop.contact -> stylus.right/contact",
    ],
}


class Hand:
    """The hand behind the stand-in: its goal above its start (m), and whether it holds button 0."""

    def __init__(self, world: HdWorld) -> None:
        self._world, self._device = world, world.devices[0]

    def go(self, height: float, *, held: bool) -> None:
        self._device.target[1], self._device.buttons = height, int(held)  # HDAPI's y is up

    def force(self) -> float:
        return float(np.linalg.norm(self._world.motors(0)))

    def until(self, fulfilled: Callable[[], bool], what: str) -> None:
        end = monotonic() + PATIENCE_S
        while not fulfilled():
            assert monotonic() < end, what
            sleep(0.02)

    def press(self) -> None:
        """Let go, take up the arm from where the hand is, and press the table until it is felt.

        The sessions' arm starts where it always does.
        """
        self.go(0.0, held=False)
        sleep(0.2)
        self.go(0.0, held=True)
        sleep(1.2)  # the arm follows, and the force comes in
        self.go(-HEIGHT - 0.01, held=True)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[bytes]]]:
    started: list[subprocess.Popen[bytes]] = []

    def popen(*arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        with (tmp_path / f"{len(started)}.log").open("wb") as log:
            command = [sys.executable, "-P", "-m", "hub.command_line", *arguments]
            started.append(
                subprocess.Popen(
                    command, stdout=log, stderr=log, env={**os.environ, **environment}, cwd=tmp_path
                )
            )
        return started[-1]

    yield popen
    for process in started:
        process.kill()
        process.wait()


@pytest.mark.long
def test_the_hub_is_killed_with_force_on_the_hand_and_another_one_is_joined(
    start: Callable[..., subprocess.Popen[bytes]], tmp_path: Path
) -> None:
    library = build.compile_library("hd.c", tmp_path / "libHD.so")
    world = HdWorld(library, tmp_path / "world")
    hand = Hand(world)
    file = tmp_path / "table.json"
    SCENARIO["participants"]["stylus"]["library"] = str(library)
    file.write_text(json.dumps(SCENARIO))
    endpoint = free_endpoint()
    own = {"TMPDIR": str(tmp_path)}  # where hubs of this test alone are found
    hub = start("run", str(file), "--listen", endpoint, **own)
    hand.until(lambda: _listens(endpoint), "the hub listens")
    start("device", "stylus", **own, **{VARIABLE: str(world.file)})  # without certificates
    hand.until(lambda: len(world.rows()) > 0, "the servo runs")
    hand.until(lambda: _presses(hand), "the hand feels the table")
    hub.kill()
    hub.wait()
    killed = monotonic()
    sleep(0.5)
    rows = world.rows(since=killed)
    pushing = rows[np.linalg.norm(rows[:, Row.FORCE], axis=1) > 0.0]
    assert len(rows) > 100
    # a tick may come late on a busy machine
    assert len(pushing) == 0 or pushing[-1, Row.TIME] - killed < 0.15 + rows[:, Row.GAP].max()
    start("run", str(file), "--listen", endpoint, **own)
    hand.until(lambda: _presses(hand), "the hand feels the table of the next session")
    forces = np.linalg.norm(world.rows()[:, Row.FORCE], axis=1)
    assert 0.5 < forces.max() <= 1.98 + 1e-9
    assert np.diff(forces).max() <= 0.1 + 1e-9


def _listens(endpoint: str) -> bool:
    host, _, port = endpoint.removeprefix("tcp/").rpartition(":")
    try:
        socket.create_connection((host, int(port)), timeout=1.0).close()
    except OSError:
        return False
    return True


def _presses(hand: Hand) -> bool:
    """Try to press, and say whether there is force; a session that has just begun may not have heard the
    button.
    """
    hand.press()
    end = monotonic() + 1.5
    while monotonic() < end and hand.force() < 0.6:
        sleep(0.02)
    return hand.force() >= 0.6
