"""The robot as an FMU: FMPy accepts and runs it, with the bits of a session."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from engines.fmu.engine import FmuEngine, FmuParams
from engines.mujoco.command_line import app
from engines.mujoco.engine import MujocoEngine
from engines.mujoco.export.fmu import write_fmu
from engines.mujoco.params import MujocoParams
from hub.participant import Inputs, Setup, Stepped, signal_out
from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from schemas.errors import ScenarioError
from schemas.ros import JointState
from tests.engines.fmus import build

pytestmark = pytest.mark.skipif(not build.USABLE, reason=build.WHY_NOT)

MS = 10**6
STEPS = 200
PSM = {"PSM1": {"instrument": "400006"}}
WHOLE = {**PSM, "PSM2": {"instrument": "ROLLING_NEEDLE_DRIVER"}, "ECM": {}}
HAND = {"PSM1": {"instrument": "MUSHA_HAND"}}


def params_of(arms: dict[str, Any], **others: Any) -> MujocoParams:
    return MujocoParams.model_validate({"arms": arms, **others})


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """FMUs of a PSM, by version of FMI."""
    folder = tmp_path_factory.mktemp("robot")
    for fmi in ("2", "3"):
        write_fmu(params_of(PSM), folder / f"{fmi}.fmu", fmi, MS)
    return {fmi: folder / f"{fmi}.fmu" for fmi in ("2", "3")}


class Loaded:
    """An FMU in FMPy, with its variables by name."""

    def __init__(self, path: Path) -> None:
        from fmpy import extract, read_model_description
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        self.model = read_model_description(str(path))
        self.references = {row.name: row.valueReference for row in self.model.modelVariables}
        self.messages: list[str] = []
        is_3 = self.model.fmiVersion == "3.0"
        kind = FMU3Slave if is_3 else FMU2Slave
        self.fmu = kind(
            guid=self.model.guid,
            unzipDirectory=extract(str(path)),
            modelIdentifier=self.model.coSimulation.modelIdentifier,
            instanceName="robot",
        )
        self.fmu.instantiate(
            **({"logMessage": lambda *given: self.messages.append(given[-1].decode())} if is_3 else {})
        )
        self._set, self._get = (
            (self.fmu.setFloat64, self.fmu.getFloat64) if is_3 else (self.fmu.setReal, self.fmu.getReal)
        )
        if not is_3:
            self.fmu.setupExperiment()
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def __setitem__(self, name: str, value: float) -> None:
        self._set([self.references[name]], [value])

    def set_all(self, names: list[str], values: list[float]) -> None:
        self._set([self.references[name] for name in names], values)

    def __getitem__(self, names: str) -> list[float]:
        """The values of the variables whose names begin so."""
        return self._get([at for name, at in self.references.items() if name.startswith(names)])

    def step(self, k: int, count: int = 1) -> None:
        self.fmu.doStep(k * 1e-3, count * 1e-3)


@contextmanager
def loaded(path: Path) -> Iterator[Loaded]:
    one = Loaded(path)
    try:
        yield one
    finally:
        one.fmu.freeInstance()


def commands(params: MujocoParams) -> list[dict[str, np.ndarray]]:
    """Setpoints that swing, for each step by port; some go beyond the range and the speed of their joints."""
    ports = [port for port in MujocoEngine("robot", params).ports if port.name.endswith("/servo_jp")]
    random = np.random.default_rng(7)
    widths = {port.name: random.normal(scale=0.3, size=len(port.names)) for port in ports}
    return [
        {
            port.name: np.array(port.start)
            + widths[port.name] * np.sin(0.01 * k + np.arange(len(port.names)))
            for port in ports
        }
        for k in range(STEPS)
    ]


def in_session(params: MujocoParams, given: list[dict[str, np.ndarray]]) -> list[dict[str, np.ndarray]]:
    """Return the outputs of the session's engine after each step."""
    engine = MujocoEngine("robot", params)
    engine.configure(Setup(period_ns=MS, directory=Path()))
    start = {p.name: np.array(p.start, float) for p in engine.ports if p.causality == "input" and p.start}
    return [
        {name: np.array(value) for name, value in engine.step(k * MS, MS, Inputs(start | one)).items()}
        for k, one in enumerate(given)
    ]


@pytest.mark.long
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_fmpy_finds_no_problem(fmus: dict[str, Path], fmi: str) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(fmus[fmi])) == []


@pytest.mark.parametrize(
    ("arms", "others", "fmi"),
    [
        (PSM, {}, "2"),
        (PSM, {}, "3"),
        (HAND, {}, "3"),
        (WHOLE, {"mounting": "cart"}, "2"),
        ({"ECM": {}}, {"timestep": "1 ms"}, "3"),
    ],
    ids=["jaw-2", "jaw-3", "hand", "cart", "ECM"],
)
def test_outputs_have_the_bits_of_a_session(
    tmp_path: Path, arms: dict[str, Any], others: dict[str, Any], fmi: Any
) -> None:
    params = params_of(arms, **others)
    write_fmu(params, tmp_path / "robot.fmu", fmi, MS)
    given = commands(params)
    expected = in_session(params, given)
    with loaded(tmp_path / "robot.fmu") as robot:
        joints = {
            port.name: [f"{port.name.replace('/', '.')}.{name}" for name in port.names]
            for port in MujocoEngine("robot", params).ports
            if port.name.endswith("/servo_jp")
        }
        for k, (one, outputs) in enumerate(zip(given, expected, strict=True)):
            for port, names in joints.items():
                robot.set_all(names, one[port].tolist())
            robot.step(k)
            for port, value in outputs.items():
                if port.endswith("/measured_js") or (port.endswith("/measured_cp") and (k + 1) % 5 == 0):
                    assert robot[port.replace("/", ".") + "."] == value.tolist(), (port, k)


class Swing(Stepped):
    """Swings the joints of a PSM."""

    ports = (
        signal_out("jp", JointState, names=("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")),
    )

    def configure(self, setup):
        return self.step(0, 0, {})

    def step(self, t, h, inputs):
        turn = 0.2 * np.sin(3e-9 * (t + h)) * np.array([1, -1, 0, 2, 1, 1])
        return {"jp": np.array([0, 0, 0.12, 0, 0, 0]) + turn}

    def state_hash(self):
        return 0

    def close(self):
        pass


@pytest.mark.long
def test_it_follows_a_recording_to_the_last_bit(fmus: dict[str, Path], tmp_path: Path) -> None:
    scenario = tmp_path / "swing.yaml"
    scenario.write_text(f"""
name: swing
step: 1 ms
duration: 300 ms
participants:
  swing: {{kind: "{__name__}:Swing"}}
  robot: {{kind: mujoco, arms: {{PSM1: {{instrument: "400006"}}}}}}
order: [swing, robot]
connections: [swing.jp -> robot.PSM1/servo_jp]
""")
    launch(load(str(scenario)), record=tmp_path / "recording").run()
    recording = Recording(tmp_path / "recording")
    given, measured = recording["swing.jp"], recording["robot.PSM1/measured_js"]
    at = dict(zip(np.rint(1e3 * given.time).astype(int).tolist(), given.values.tolist(), strict=True))
    names = [f"PSM1.servo_jp.{name}" for name in given.names]
    with loaded(fmus["3"]) as robot:
        compared = 0
        for time, row in zip(
            np.rint(1e3 * measured.time).astype(int).tolist(), measured.values.tolist(), strict=True
        ):
            if time > 0:
                robot.set_all(names, at[time])  # the robot steps after it
                robot.step(time - 1)
            assert robot["PSM1.measured_js."] == row, time
            compared += 1
    assert compared >= 300
    assert np.ptp(measured["position.yaw"]) > 0.1


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_fmpy_simulates_it(fmus: dict[str, Path], fmi: str) -> None:
    from fmpy import simulate_fmu

    found = simulate_fmu(
        str(fmus[fmi]), stop_time=0.3, output_interval=0.01, start_values={"PSM1.servo_jp.yaw": 0.1}
    )
    assert len(found) == 31
    assert found["PSM1.measured_js.position.yaw"][-1] == pytest.approx(0.1, abs=3e-3)
    assert found["PSM1.jaw.measured_js.position.jaw"][-1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.long
@pytest.mark.parametrize("fmi", ["2", "3"])
def test_a_state_is_taken_back_and_comes_from_another_instance(fmus: dict[str, Path], fmi: str) -> None:
    word, deserialize = {"2": ("FMUstate", "deSerialize"), "3": ("FMUState", "deserialize")}[fmi]
    with loaded(fmus[fmi]) as robot, loaded(fmus[fmi]) as other:
        robot["PSM1.servo_jp.pitch"] = 0.2
        robot["PSM1.tip_force.z"] = -1.0
        robot.step(0, 40)
        state = getattr(robot.fmu, f"get{word}")()
        raw = getattr(robot.fmu, f"serialize{word}")(state)
        robot["gravity"] = 3.0
        robot.step(40, 25)
        first = robot["PSM1."]
        getattr(robot.fmu, f"set{word}")(state)
        assert robot["gravity"] == [9.81]
        robot["gravity"] = 3.0
        robot.step(40, 25)
        assert robot["PSM1."] == first
        getattr(other.fmu, f"set{word}")(getattr(other.fmu, f"{deserialize}{word}")(raw))
        other["gravity"] = 3.0
        other.step(40, 25)
        assert other["PSM1."] == first
        robot.fmu.reset()


def test_a_force_at_the_tip_moves_the_arm_that_way(fmus: dict[str, Path]) -> None:
    with loaded(fmus["3"]) as robot, loaded(fmus["3"]) as free:
        robot["PSM1.tip_force.x"] = 2.0
        for one in (robot, free):
            one.step(0, 300)
        moved = np.subtract(robot["PSM1.measured_cp.position"], free["PSM1.measured_cp.position"])
        assert 1e-5 < moved[0] < 5e-3
        assert abs(moved[0]) > np.abs(moved[1:]).max()
        robot["PSM1.tip_force.x"] = 0.0
        for one in (robot, free):
            one.step(300, 700)
        back = np.subtract(robot["PSM1.measured_cp.position"], free["PSM1.measured_cp.position"])
        assert np.abs(back).max() < moved[0]


class TestRefusals:
    def test_in_the_fmu(self, fmus: dict[str, Path]) -> None:
        from fmpy.fmi1 import FMICallException

        with loaded(fmus["3"]) as robot:
            refused = [
                (
                    lambda: robot.fmu.doStep(0.0, 0.0015),
                    "a communication step of 0.0015 s; it must be a multiple",
                ),
                (lambda: robot.fmu.doStep(1.0, 0.001), "a step from 1 s; the robot is at 0 s"),
                (lambda: robot.set_all(["PSM1.servo_jp.yaw"], [np.nan]), "'PSM1.servo_jp.yaw' is set to nan"),
                (lambda: robot.set_all(["gravity"], [-1.0]), "allowed are 0 to 25"),
                (lambda: robot.set_all(["PSM1.measured_cp.position.x"], [0.0]), "no input or parameter"),
                (lambda: robot.fmu.deserializeFMUState(b"nothing"), "7 bytes are no state"),
            ]
            for call, message in refused:
                with pytest.raises(FMICallException):
                    call()
                assert message in robot.messages[-1]
            robot.step(0)  # and goes on

    @pytest.mark.parametrize(
        ("others", "expected"),
        [
            ({"objects": {"ring": {"kind": "ring", "position": [0, 0, 1]}}}, "objects"),
            ({"lean": True}, "a lean model"),
            ({"measured_effort": "motor"}, "measured_effort: motor"),
        ],
    )
    def test_of_scenes(self, tmp_path: Path, others: dict[str, Any], expected: str) -> None:
        with pytest.raises(ScenarioError, match=f"not {expected}"):
            write_fmu(params_of(PSM, **others), tmp_path / "robot.fmu", "3", MS)

    def test_of_machines(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("engines.mujoco.export.fmu.archive.platform.machine", lambda: "aarch64")
        with pytest.raises(ScenarioError, match=r"made on Linux \(x86_64\), not on linux aarch64.*--fmi 3"):
            write_fmu(params_of(PSM), tmp_path / "robot.fmu", "2", MS)
        monkeypatch.undo()
        monkeypatch.setattr("engines.mujoco.export.fmu.archive.shutil.which", lambda _: None)
        with pytest.raises(ScenarioError, match="there is no 'cc' here"):
            write_fmu(params_of(PSM), tmp_path / "robot.fmu", "2", MS)


def test_an_engine_of_trocar_runs_it_and_hashes_its_state(fmus: dict[str, Path], tmp_path: Path) -> None:
    with FmuEngine("robot", FmuParams(path=fmus["3"])) as engine:
        engine.configure(Setup(period_ns=MS, directory=tmp_path))
        start = {p.name: np.array(p.start, float) for p in engine.ports if p.causality == "input"}
        before = engine.save()
        outputs = engine.step(0, MS, Inputs(start | {"PSM1/servo_jp/yaw": np.array([0.1])}))
        first = {name: value.tolist() for name, value in outputs.items()}
        assert engine._hashes_state
        engine.restore(before)
        again = engine.step(0, MS, Inputs(start | {"PSM1/servo_jp/yaw": np.array([0.1])}))
        assert {name: value.tolist() for name, value in again.items()} == first


class TestCommand:
    def test_the_suffix_is_the_format(self, tmp_path: Path) -> None:
        path = tmp_path / "psm.fmu"
        found = CliRunner().invoke(
            app, ["export", str(path), "--arms", "PSM1", "--mounting", "free", "--fmi", "2"]
        )
        assert found.exit_code == 0, found.output
        assert "FMI 2.0 co-simulation, 13 inputs, 34 outputs, steps of 1 ms" in found.output.replace("\n", "")
        assert path.is_file()

    def test_a_step_that_the_physics_cannot_take(self, tmp_path: Path) -> None:
        found = CliRunner().invoke(app, ["export", str(tmp_path / "psm.fmu"), "--step", "0.7 ms"])
        assert "0.7 ms is no multiple of the physics' sub-step of 0.5 ms" in str(found.exception)
