"""Bonds of FMUs: units, slopes, masses, work, and a session with a book of energy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import configs
from engines.fmu.engine import FmuEngine, FmuParams
from hub.participant import BondPlan, Setup
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.testing import check_engine
from hub.verify import verify
from schemas.errors import ScenarioError
from schemas.ports import bond_ports
from tests.engines.fmu.driving import MS, SPRING, Make
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

DRIVE = Path(configs.__file__).parent / "data" / "tendon_drive"
IMPULSE = BondPlan(prediction="velocity", mean=True)
MASS = {"side": "motion", "force": "F", "position": "x", "velocity": "v"}
JOINT = {"side": "force", "force": "force", "position": "position", "velocity": "velocity"}


def drive(bond: dict[str, Any] | None = None, path: Path = DRIVE, **params: Any) -> FmuEngine:
    bonds = {"joint": JOINT | (bond or {})}
    return FmuEngine("drive", FmuParams.model_validate({"path": path, "bonds": bonds} | params))


def copied_drive(tmp_path: Path, *edits: tuple[str, str]) -> Path:
    """Copy the drive with changes in modelDescription.xml."""
    text = (DRIVE / "modelDescription.xml").read_text()
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "drive" / "sources").mkdir(parents=True)
    (tmp_path / "drive" / "modelDescription.xml").write_text(text)
    source = (DRIVE / "sources" / "tendon_drive.c").read_text()
    (tmp_path / "drive" / "sources" / "tendon_drive.c").write_text(source)
    return tmp_path / "drive"


def configured(engine: FmuEngine, period: int = MS) -> FmuEngine:
    bonds = {side.name: IMPULSE for side in engine.bonds}
    engine.configure(Setup(period_ns=period, directory=DRIVE, bonds=bonds))
    return engine


@pytest.mark.parametrize("plan", [IMPULSE, BondPlan(prediction="slope", mean=True)])
def test_the_force_side_keeps_the_contract(plan: BondPlan) -> None:
    inputs = {"joint/position": [-1e-4], "joint/velocity": [-0.03], "command": [0.001]}
    check_engine(lambda: drive(step="100 us"), period_ns=MS, inputs=inputs, bonds={"joint": plan})


def test_the_motion_side_keeps_the_contract(make: Make) -> None:
    def make_mass() -> FmuEngine:
        return make(SPRING, period=0, bonds={"tip": MASS}, step="100 us")

    check_engine(make_mass, period_ns=MS, inputs={"tip/force": [2.0]})


def test_a_bond_takes_the_inputs_and_leaves_the_outputs(make: Make) -> None:
    engine = make(SPRING, period=0, bonds={"tip": MASS})
    names = {port.name for port in engine.ports}
    assert {"x", "v"} <= names
    assert "F" not in names
    assert [port.unit for port in bond_ports(engine.bonds[0])] == ["m", "m/s", "N"]


def test_multiples_of_units_are_converted(make: Make) -> None:
    engine = make(SPRING, period=0, bonds={"tip": MASS | {"position": "x_mm"}}, start={"x": 0.25})
    outputs = engine.configure(Setup(period_ns=MS, directory=DRIVE, bonds={"tip": IMPULSE}))
    assert outputs["tip/position"] == pytest.approx([0.25])


def test_angles_are_known_by_their_units(tmp_path: Path) -> None:
    path = copied_drive(
        tmp_path,
        ('position of the joint"><Real unit="m"', 'position of the joint"><Real unit="deg"'),
        ('velocity of the joint"><Real unit="m/s"', 'velocity of the joint"><Real unit="deg/s"'),
        ('cable on the joint"><Real unit="N"', 'cable on the joint"><Real unit="N.m"'),
        ('<Unit name="1">', '<Unit name="deg"/><Unit name="deg/s"/><Unit name="N.m"/><Unit name="1">'),
    )
    engine = configured(drive(path=path, start={"backlash": 0.0}))
    side = engine.bonds[0]
    assert side.coordinate == "angle"
    assert side.stiffness == pytest.approx(50e3 * 180 / np.pi)
    engine.close()


@pytest.mark.parametrize(
    ("bond", "text"),
    [
        ({"position": "body.a[1]"}, "position in 'm/s2', velocity in 'm/s', force in 'N'; a bond needs"),
        ({"coordinate": "angle"}, r"a bond needs rad, rad/s, N\*m \(angle\), or multiples"),
        ({"position": "y"}, "has no output 'y' for the position of bond 'tip'"),
        ({"force": "x"}, "has no input 'x' for the force of bond 'tip'"),
        ({"force": "locked"}, "'locked' of .* is discrete, and a bond takes continuous doubles"),
        ({"position": ["x", "x"]}, "need as many numbers, 1 to 3, but have position 2, velocity 1, force 1"),
    ],
)
def test_what_does_not_fit_is_named(make: Make, bond: dict[str, Any], text: str) -> None:
    with pytest.raises(ScenarioError, match=text):
        _ = make(SPRING, period=0, bonds={"tip": MASS | bond}).ports


def test_an_input_belongs_to_one_bond(make: Make) -> None:
    with pytest.raises(ScenarioError, match="input 'F' is set twice by bonds"):
        _ = make(SPRING, period=0, bonds={"tip": MASS, "end": MASS}).ports


def test_numbers_belong_to_their_side() -> None:
    with pytest.raises(ValueError, match="a motion side has no stiffness"):
        FmuParams.model_validate({"path": DRIVE, "bonds": {"tip": MASS | {"stiffness": 1.0}}})


def test_the_mass_of_a_motion_side_is_measured(make: Make) -> None:
    engine = configured(make(SPRING, period=0, bonds={"tip": MASS}, start={"m": 0.25}))
    assert engine.bonds[0].effective_mass == pytest.approx(0.25, rel=1e-3)


def test_slopes_are_directional_derivatives_or_measured(tmp_path: Path) -> None:
    given = configured(drive(start={"backlash": 0.0}))
    bare = copied_drive(tmp_path, (' providesDirectionalDerivative="true"', ""))
    measured = configured(drive(path=bare, start={"backlash": 0.0}), period=MS // 100)
    stated = configured(drive({"stiffness": 7e4}, start={"backlash": 0.0}))
    assert given.bonds[0].stiffness == pytest.approx(50e3)
    assert measured.bonds[0].stiffness == pytest.approx(50e3, rel=1e-2)
    assert stated.bonds[0].stiffness == 7e4
    for engine in (given, measured, stated):
        engine.close()


def test_without_interpolation_the_slopes_bring_the_force_to_the_end(tmp_path: Path) -> None:
    """A cable between a motor that stands and a joint that moves away at an even speed."""
    still = {"rotor_inertia": 1e3, "backlash": 0.0, "cable_damping": 0.0}
    bare = copied_drive(tmp_path, (' canInterpolateInputs="true"', ""))
    results: list[float] = []
    for path in (DRIVE, bare):
        engine = drive(path=path, step="250 us", start=still)
        with_inputs = {"joint/position": [0.0], "joint/velocity": [0.02], "command": [0.0]}
        results.append(pull(configured(engine), with_inputs))
        engine.close()
    # the mean of -k v t over the tenth step of a millisecond
    assert results == pytest.approx([-50e3 * 0.02 * 9.5e-3] * 2, rel=1e-6)


def pull(engine: FmuEngine, given: dict[str, list[float]]) -> float:
    from hub.participant import Inputs

    values = {name: np.array(value) for name, value in given.items()}
    outputs: Any = {}
    for step in range(10):
        values["joint/position"] = np.array([0.02 * step * 1e-3])
        outputs = engine.step(step * MS, MS, Inputs(dict(values)))
    return float(outputs["joint/force"][0])


SCENARIO = """\
name: two_fmus
step: 500 us
duration: 1 s
participants:
  mass:
    kind: fmu
    path: mass.fmu
    step: 100 us
    start: {m: 0.4, c: 0, d: 2}
    bonds: {tip: {side: motion, force: F, position: x, velocity: v}}
  drive:
    kind: fmu
    path: DRIVE
    step: 100 us
    start: {command: 5 mm}
    bonds: {joint: {side: force, force: force, position: position, velocity: velocity, stiffness: 50000}}
bonds:
  - {motion: mass.tip, force: drive.joint}
"""


@pytest.fixture
def scenario(libraries: dict[str, Path], tmp_path: Path) -> Path:
    build.pack(SPRING, libraries[SPRING], tmp_path / "mass.fmu")
    path = tmp_path / "two-fmus.yaml"
    path.write_text(SCENARIO.replace("DRIVE", str(DRIVE)))
    return path


@pytest.mark.long
def test_a_session_of_two_fmus_keeps_its_book_and_verifies(scenario: Path, tmp_path: Path) -> None:
    """The motor pulls the mass 5 mm along, with all the current there is; then both swing."""
    summary = launch(load(str(scenario), ["participants.drive.host=drive"]), record=tmp_path / "rec").run()
    assert summary.state == "done"
    recording = Recording(tmp_path / "rec")
    work = np.array([entry.motion_work_j for _, entry in recording.energy("mass/tip")])
    exchanged = float(np.abs(np.diff(work)).sum())
    assert exchanged > 1e-3
    assert abs(summary.energy_residual_j) < 1e-3 * exchanged
    assert verify(recording, trust=True).same


def test_a_step_too_long_for_the_cable_is_refused(scenario: Path) -> None:
    with pytest.raises(ScenarioError, match=r"breaks the rule H <= 0.25 sqrt\(m/k_contact\) of 'impulse'"):
        launch(load(str(scenario), ["step=1 ms"])).run()
