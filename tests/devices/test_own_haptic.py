"""The driver of docs/how-to/own-haptic-device.md, in the real servo process."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from time import monotonic, monotonic_ns, sleep
from typing import Any

import pytest

from hub.participant import Device, Sample
from schemas.ros import DiagnosticStatus, Header, Time, Vector3, WrenchStamped
from schemas.trocar_msgs import ContactModel, ContactPlane

ROOT = Path(__file__).parents[2]
KNOB = ROOT / "examples" / "knob"
PATIENCE_S = 60.0


@pytest.fixture
def knob(monkeypatch: pytest.MonkeyPatch) -> Iterator[Device]:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(KNOB), os.environ.get("PYTHONPATH", ""))))
    monkeypatch.syspath_prepend(str(KNOB))
    example: Any = __import__("trocar_example_knob")
    with example.Knob("knob", example.KnobParams()) as made:
        made.open(Path())
        yield made


class _Session:
    """Reads the device and sends it a floor at height 0."""

    def __init__(self, device: Device) -> None:
        self._device, self._start = device, monotonic_ns()
        self.forces: list[float] = []
        self.conditions: list[str] = []

    def until(self, is_over: Any, *, floor: bool) -> None:
        end = monotonic() + PATIENCE_S
        while not is_over():
            assert monotonic() < end, (self.forces[-3:], self.conditions)
            now = monotonic_ns() - self._start
            if floor:
                plane = ContactPlane(
                    normal=Vector3(z=1.0), distance=0.0, stiffness=200.0, damping=1.0, friction=0.0
                )
                model = ContactModel(header=Header(stamp=Time.from_ns(now)), planes=[plane])
                self._device.write("right/contact", model)
            for sample in self._device.read(now) or ():
                self._observe(sample)
            sleep(0.002)

    def _observe(self, sample: Sample) -> None:
        message = sample.message
        if sample.port == "right/force" and isinstance(message, WrenchStamped):
            self.forces.append(message.wrench.force.z)
        elif isinstance(message, DiagnosticStatus):
            self.conditions.append(message.message)


def test_the_hand_feels_the_floor_and_nothing_after_the_simulation_is_silent(knob: Device) -> None:
    session = _Session(knob)
    session.until(lambda: bool(session.forces) and session.forces[-1] > 0.3, floor=True)
    assert max(session.forces) < 0.6 * 3.3
    session.until(lambda: session.forces[-1] == 0.0, floor=False)
    session.until(lambda: any("no contact model arrives" in text for text in session.conditions), floor=False)


def test_the_page_shows_the_example_as_it_is() -> None:
    page = (ROOT / "docs" / "how-to" / "own-haptic-device.md").read_text(encoding="utf-8")
    for file in sorted(KNOB.glob("trocar_*.py")):
        assert f'```python title="examples/knob/{file.name}"\n{file.read_text(encoding="utf-8")}```' in page


def test_a_driver_is_imported_without_the_device_and_its_libraries() -> None:
    code = "import sys, trocar_example_knob_driver; print(*{'numpy', 'pydantic', 'hub'} & {*sys.modules})"
    place = {**os.environ, "PYTHONPATH": str(KNOB)}
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, env=place, capture_output=True, text=True, check=True)
    assert not done.stdout.strip()
