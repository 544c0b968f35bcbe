import sys

import pytest

from hub.planning.scenario_file import load
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.session.launch import launch
from hub.verify import verify
from schemas.errors import RecordingError

SCENARIO = """\
name: swinging
step: 1 ms
duration: 20 ms
window: 4
participants:
  one: {kind: pendulum, length: 1}
  two: {kind: pendulum, length: 1, period: 2 ms}
connections:
  - one.angle -> two.goal
"""


@pytest.fixture
def recording(pendulum, tmp_path):
    (tmp_path / "session.yaml").write_text(SCENARIO)
    summary = launch(load(str(tmp_path / "session.yaml")), record=tmp_path / "recording").run()
    assert summary.recording_complete
    return Recording(tmp_path / "recording")


def test_the_same_bits_come_out_again(recording):
    summary = verify(recording)
    assert (summary.same, summary.steps, summary.hashes) == (True, 20, 20 + 10)
    assert summary.first_difference_step is None


@pytest.mark.parametrize(("step", "participant", "first"), [(7, "one", 7), (7, "two", 8), (0, "one", 0)])
def test_the_first_difference_is_named(recording, monkeypatch, step, participant, first):
    engine = sys.modules["swing"].Pendulum
    honest = engine.step

    def step_with_an_error(self, t, h, inputs):
        outputs = honest(self, t, h, inputs)
        if self.name == participant and t >= step * 1_000_000:
            self.angle = self.angle + 1e-15
        return {**outputs, "angle": self.angle}

    monkeypatch.setattr(engine, "step", step_with_an_error)
    summary = verify(recording)
    assert (summary.same, summary.first_difference_step, summary.first_difference_participant) == (
        False,
        first,
        participant,
    )


def test_a_recording_of_something_else_is_refused(tmp_path):
    from hub.planning.scenario_file import installed_scenarios

    with pytest.raises(RecordingError, match="holds no scenario: it was not recorded by `trocar run`"):
        verify(Recording(installed_scenarios()["palpation"].parent / "data" / "palpation_hand"))


@pytest.mark.parametrize(
    ("step", "start_ns", "horizon_ns"),
    [
        (4, 4_000_000, 8_000_000),
        (0, 1, 4_000_000),
        (0, 0, 4_000_001),
        (0, 0, 0),
        (0, 0, -1_000_000),
        (0, 0, 10**18),
    ],
)
def test_grants_that_do_not_follow_one_another_are_refused(
    recording, monkeypatch, step, start_ns, horizon_ns
):
    first = next(recording.grants())
    wrong = first.model_copy(update={"step": step, "start_ns": start_ns, "horizon_ns": horizon_ns})
    monkeypatch.setattr(Recording, "grants", lambda _: iter([wrong]))
    with pytest.raises(RecordingError, match="the grant of step 0 should follow"):
        verify(recording)


def test_a_start_that_is_no_time_is_named(tmp_path):
    with Recorder(tmp_path / "run", attachments={"origin.json": b'{"started_ns": "noon"}'}):
        pass
    with pytest.raises(RecordingError, match=r"origin\.json has the start 'noon'"):
        Recording(tmp_path / "run").started_ns()
