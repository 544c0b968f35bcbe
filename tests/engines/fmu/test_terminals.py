"""Terminals of FMI 3.0 FMUs as bonds, and bonds of FMI 3.0 FMUs in a session."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from engines.fmu.bond_params import FmuBond
from engines.fmu.engine import FmuEngine, FmuParams
from hub.participant import BondPlan, Setup
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.testing import check_engine
from hub.verify import verify
from schemas.errors import ScenarioError
from tests.engines.fmu.driving import MS, SPRING, Make
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

FLANGES = "flanges"
IMPULSE = BondPlan(prediction="velocity", mean=True)
TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"


@pytest.fixture(scope="session")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build.compile_library(FLANGES, tmp_path_factory.mktemp(FLANGES))


@pytest.fixture
def fmu(library: Path, tmp_path: Path) -> Path:
    return build.pack(FLANGES, library, tmp_path / "flanges.fmu")


def bonded(fmu: Path, terminal: str, **others: Any) -> FmuEngine:
    params = {"path": fmu, "bonds": {"shaft": {"terminal": terminal, **others}}, "step": "100 us"}
    return FmuEngine("part", FmuParams.model_validate(params))


@pytest.mark.parametrize(
    ("terminal", "side", "sign"), [("spring", "force", -1.0), ("rotor.flange", "motion", 1.0)]
)
def test_members_are_told_apart_by_kind_and_unit(fmu: Path, terminal: str, side: str, sign: float) -> None:
    engine = bonded(fmu, terminal)
    (found,) = engine.bonds
    assert (found.side, found.coordinate, found.dof) == (side, "angle", 1)
    names = {"spring": ("phi", "w", "tau"), "rotor.flange": ("angle", "speed", "push")}[terminal]
    (bond,) = engine._description.bonds
    assert [one.variables[0].name for one in (bond.position, bond.velocity, bond.force)] == [*names]
    assert bond.force.factor == sign


@pytest.mark.parametrize(
    ("terminal", "inputs"),
    [
        ("spring", {"shaft/position": [-1e-4], "shaft/velocity": [-0.03]}),
        ("rotor.flange", {"shaft/force": [0.2]}),
    ],
)
def test_both_sides_keep_the_contract_under_fmi_3(fmu: Path, terminal: str, inputs: dict[str, Any]) -> None:
    check_engine(lambda: bonded(fmu, terminal), period_ns=MS, inputs=inputs, bonds={"shaft": IMPULSE})


def test_slopes_and_masses_are_those_of_the_fmu(fmu: Path) -> None:
    for terminal, name, expected in (("spring", "stiffness", 50.0), ("rotor.flange", "effective_mass", 0.02)):
        with bonded(fmu, terminal) as engine:
            engine.configure(Setup(period_ns=MS, directory=fmu.parent, bonds={"shaft": IMPULSE}))
            assert getattr(engine.bonds[0], name) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("terminal", "expected"),
    [
        ("shaft", "the FMU has no terminal 'shaft'"),
        ("half", "terminal 'half' has no force and no velocity"),
        ("warm", r"'heat' of terminal 'warm' \(signal\) in 'K' is neither a flow, nor a position"),
        ("gone", "terminal 'gone' has 'torque', which is no variable"),
        ("both", "terminal 'both' mixes inflow and outflow"),
    ],
)
def test_a_terminal_that_is_no_bond_says_why(fmu: Path, terminal: str, expected: str) -> None:
    with pytest.raises(ScenarioError, match=expected) as caught:
        _ = bonded(fmu, terminal).ports
    assert caught.value.path == ("participants", "part", "bonds", "shaft", "terminal")
    assert "State side, force, position and velocity instead" in str(caught.value)


def test_an_fmu_without_terminals(make: Make) -> None:
    with pytest.raises(ScenarioError, match=rf"the FMU has no terminals \({TERMINALS}\)"):
        _ = make(SPRING, period=0, bonds={"tip": {"terminal": "tip"}}).ports


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"terminal": "shaft", "force": "tau"}, "a terminal says what is force"),
        ({"side": "force", "force": "tau", "position": "phi"}, "velocity missing"),
    ],
)
def test_a_bond_is_stated_once(given: dict[str, Any], expected: str) -> None:
    with pytest.raises(ValidationError, match=expected):
        FmuBond.model_validate(given)


def test_a_number_of_the_other_side(fmu: Path) -> None:
    with pytest.raises(ScenarioError, match="a motion side has no stiffness"):
        _ = bonded(fmu, "rotor.flange", stiffness=1.0).ports


@pytest.mark.long
def test_a_rotor_swings_on_a_spring_with_a_book_of_energy(fmu: Path, tmp_path: Path) -> None:
    """Both are FMUs of FMI 3.0: the period is that of theory, and the book closes."""
    (tmp_path / "swing.yaml").write_text(
        "name: swing\nstep: 1 ms\nduration: 1 s\nparticipants:\n"
        "  rotor: {kind: fmu, path: flanges.fmu, step: 100 us, start: {angle: 0.1},"
        " bonds: {shaft: {terminal: rotor.flange}}}\n"
        "  spring: {kind: fmu, path: flanges.fmu, step: 100 us, bonds: {shaft: {terminal: spring}}}\n"
        "bonds: [{motion: rotor.shaft, force: spring.shaft}]\n"
    )
    summary = launch(load(str(tmp_path / "swing.yaml")), record=tmp_path / "recording").run()
    assert summary.state == "done"
    recording = Recording(tmp_path / "recording")
    angle = recording["rotor.angle"].values[:, 0]
    time = recording["rotor.angle"].time
    expected = 0.1 * np.cos(math.sqrt(50.0 / 0.02) * time)
    assert np.abs(angle - expected).max() < 2e-3
    books = [(entry.motion_work_j, entry.residual_j) for _, entry in recording.energy("rotor/shaft")]
    work, residual = np.array(books).T
    assert np.abs(residual).max() < 1e-3 * np.abs(np.diff(work)).sum()
    assert verify(recording, trust=True).same
