"""Operations in the court: sessions put together, rows of their cards, and a short one for real."""

import pytest

import trocar
from hub.planning.scenario_file import installed_scenarios
from learning.judge import operation_trial
from learning.judge.episode import Trial
from learning.judge.operation_trial import judge_operation, row_of
from learning.judge.operations import OPERATION_FAILURES, OPERATIONS, Operation
from learning.judge.page import write_page
from learning.judge.policies import PolicyAddress
from learning.judge.suites import exercises_of
from learning.judge.verdict import judge_trials
from schemas.errors import ScenarioError
from schemas.ros import Header, Time
from schemas.trocar_msgs import TaskEvent

TRIAL = Trial("ClipAndCut", "nominal", 3)
SERVER = "openpi://localhost:8000"
STAYING = '''
class Stay:
    """Stays, and opens and shuts all jaws."""

    def __init__(self, contract):
        self.asked = 0

    def act(self, observation):
        self.asked += 1
        row = observation["state"].astype(float)
        row[7::8] = 0.6 if self.asked < 3 else 0.0
        return [row] * 10
'''


def order(name=SERVER, difficulty="nominal", contract=None, execute=5):
    return OPERATIONS["ClipAndCut"].order(PolicyAddress(name, contract, execute), difficulty, 3)


def ended(**changes):
    """Return the results of a session in which a tube was torn at 12 s."""
    numbers = {
        "success": 0.0,
        "failed/common_duct_injured": 0.0,
        "failed/tube_torn": 1.0,
        "failed/not_finished": 1.0,
        "errors": 1.0,
        "errors/tube_torn": 1.0,
    } | changes.pop("metrics", {})
    card = {name: {"value": value, "unit": ""} for name, value in numbers.items()}
    card["goal/duct_cut"] = {"value": None, "unit": "s", "reason": "not reached"}
    given = {"error": None, "sim_time_s": 30.0, "steps": 15000, "progress": 0.4, "state_hash": "ab"}
    return {**given, "scores": {"task": {"metrics": card}}, **changes}


def event(kind, time):
    return TaskEvent(header=Header(stamp=Time.from_ns(round(time * 1e9)), frame_id="world"), event=kind)


EVENTS = [event("gallbladder grasped", 5.0), event("tube torn", 12.0), event("drop", 20.0)]


def test_a_suite_of_its_own_with_few_seeds():
    assert exercises_of("operation") == ("ClipAndCut",)
    assert "ClipAndCut" not in exercises_of("all")
    with pytest.raises(ScenarioError, match="no suite and no exercise 'operaton'"):
        exercises_of("operaton")


def test_the_routine_operates_on_the_patient_of_the_seed():
    assert order("expert") == ("clip-and-cut", {"scene.seed": 3})
    errors = order("expert", "joint-errors").settings
    assert errors["participants.motion.joint_errors"] == {"within": ["2.5 deg", "2.5 deg", "2 mm"], "seed": 3}
    with pytest.raises(ScenarioError, match="no link with a delay"):
        order("expert", "latency-100")


def test_a_policy_answers_the_governor_of_a_valid_session():
    made = order(difficulty="latency-100", contract={"rate": 30, "instruction": "grasp"}, execute=10)
    made.check()
    loaded = trocar.load_scenario(made.scenario, set=made.settings)
    governor, device = (loaded.params[name] for name in ("governor", "policy"))
    assert (governor.contract.arms, governor.contract.rate) == (("PSM1", "PSM2", "PSM3"), 30)
    assert governor.execute == 10
    assert (device.backend, device.episode) == (SERVER, 3)
    assert loaded.scenario.participants["policy"].network_link.delay == 100_000_000
    assert loaded.scenario.participants["endoscope"].period == 332_000_000  # ten rows, in whole steps


def test_a_policy_without_pictures_costs_no_drawing():
    made = order(contract={"cameras": {}})
    made.check()
    assert made.settings["participants.endoscope.images"] == "none"
    assert not any("policy.endoscope" in text for text in made.settings["connections"])


def test_files_of_a_policy_are_those_of_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text("")
    for name in ("python:mine.py:Mine", "python:mine:Mine"):
        backend = order(name).settings["participants.policy.backend"]
        assert backend == f"python:{tmp_path / 'mine.py'}:Mine"


@pytest.mark.parametrize(
    ("name", "contract", "words"),
    [
        ("random", None, "acts in environments"),
        ("mine:Mine", None, "acts in environments"),
        (SERVER, {"cameras": {"chest": {}}}, "camera 'chest': there are endoscope/left and"),
        (SERVER, {"cameras": {"endoscope/left": {}, "endoscope/right": {"width": 64}}}, "one size"),
        (SERVER, {"frame": "base"}, "frame 'base': 'clip-and-cut-by-policy' has 'world'"),
        (SERVER, {"horizon": 0}, "the contract is not valid"),
    ],
)
def test_what_no_session_can_have(name, contract, words):
    with pytest.raises(ScenarioError, match=words):
        order(name, contract=contract)


def test_the_gravest_failure_names_the_class_and_its_error_the_instant():
    row = row_of(TRIAL, ended(), EVENTS, "")
    assert (row["success"], row["failure"], row["decisive_s"]) == (False, "tube torn", 12.0)
    assert row["first"] == {"gallbladder grasped": 5.0, "tube torn": 12.0, "drop": 20.0}
    assert row["distance"] == pytest.approx(0.6)
    assert "goal/duct_cut (s)" not in row["metrics"]


def test_a_success_and_a_policy_that_gave_up():
    done = {"success": 1.0, "failed/tube_torn": 0.0, "failed/not_finished": 0.0}
    assert row_of(TRIAL, ended(metrics=done), EVENTS, "")["failure"] is None
    late = ended(metrics={"failed/tube_torn": 0.0, "errors/tube_torn": 0.0})
    assert row_of(TRIAL, late, EVENTS, "the arms hold")["failure"] == "not finished"
    silent = row_of(TRIAL, late | {"condition": 3.0}, EVENTS, "the arms hold: the server is away")
    assert (silent["failure"], silent["error"]) == ("policy failed", "the arms hold: the server is away")
    dead = row_of(TRIAL, {"error": "killed by signal 9"}, [], "")
    assert (dead["failure"], dead["steps"], dead["decisive_s"]) == ("session failed", 0, 0.0)


def test_the_page_explains_the_classes_of_an_operation(tmp_path):
    described = {"policy": "expert", "difficulties": ["nominal"], "trocar": "0", "recorded": True}
    write_page(described, [row_of(TRIAL, ended(), EVENTS, "")], tmp_path / "index.html")
    page = (tmp_path / "index.html").read_text()
    assert OPERATION_FAILURES["tube torn"] in page
    assert "trocar view trials/ClipAndCut-nominal-00003 --at 12.00" in page
    assert "never handed over" not in page


def test_a_contract_that_does_not_fit_is_a_row():
    row = judge_operation(PolicyAddress(SERVER, {"horizon": 0}), TRIAL, None)
    assert row["failure"] == "session failed"
    assert "the contract is not valid" in row["error"]


@pytest.mark.search
@pytest.mark.timeout(3600)
def test_a_policy_in_a_short_operation_verifies_without_the_policy(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("clip-and-cut", "clip-and-cut-by-policy"):
        text = installed_scenarios()[name].read_text().replace("duration: 150 s", "duration: 1 s")
        (tmp_path / f"{name}.yaml").write_text(text)
    short = Operation(str(tmp_path / "clip-and-cut.yaml"), str(tmp_path / "clip-and-cut-by-policy.yaml"))
    monkeypatch.setattr(operation_trial, "OPERATIONS", {"ClipAndCut": short})
    (tmp_path / "stay.py").write_text(STAYING)
    address = PolicyAddress("python:stay.py:Stay", {"cameras": {}})
    (row,) = judge_trials(address, [TRIAL], str(tmp_path))
    assert (row["failure"], row["error"], row["steps"]) == ("not finished", None, 500)
    recording = tmp_path / TRIAL.name
    assert len(trocar.Recording(recording)["governor.PSM1/clip"]) == 1
    (tmp_path / "stay.py").unlink()
    assert trocar.verify(recording).same
