"""The work that `bench/live.py` times as bare is the session's own."""

import json

import pytest

from bench import live, live_table
from bench.live_table import redrawn

TEXT = """\
name: short
step: 1 ms
duration: 30 ms
participants:
  one: {kind: "toys:Mixer", seed: 1, host: other}
  two: {kind: "toys:Mixer", seed: 2, period: 2 ms, step_ns: 2000000}
  talker: {kind: "toys:Talker"}
  listener: {kind: "toys:Listener", period: 2 ms}
order: [one, two]
connections:
  - one.out -> two.a
  - {source: two.out, target: one.b, extrapolation: linear}
  - talker.words -> listener.words
"""


@pytest.fixture
def scenario(toys, tmp_path):
    file = tmp_path / "short.yaml"
    file.write_text(TEXT)
    return str(file)


def test_bare_steps_reach_the_states_of_the_session(scenario):
    captured = live.capture(scenario, 0.03)
    assert {name: len(hashes) for name, hashes in captured.hashes.items()} == {
        "one": 30,
        "two": 15,
        "talker": 30,
        "listener": 15,
    }
    live.run_bare(scenario, 0.03, captured, check=True)
    assert live.run_bare(scenario, 0.03, captured).wall_s > 0.0
    captured.hashes["two"][7] ^= 1
    with pytest.raises(ValueError, match="'two' reached another state than in the session at 14000000 ns"):
        live.run_bare(scenario, 0.03, captured, check=True)


def test_a_session_is_measured_with_its_hosts(scenario):
    cost = live.run_session(live.Case("short", scenario, recorded=True), 0.03)
    assert 0.0 < cost.sim_s <= 0.03
    assert cost.wall_s > 0.0


LOOKING = """\
name: looking
step: 2 ms
participants:
  jelly: {kind: "toys:Jelly"}
  camera: {kind: "toys:Camera", period: 20 ms, milliseconds: 30}
connections:
  - jelly.* -> camera.*
"""


def test_what_a_session_could_reach_is_measured_where_cameras_only_look(scenario, tmp_path):
    assert live.run_attainable(live.Case("short", scenario), 0.03) is None
    file = tmp_path / "looking.yaml"
    file.write_text(LOOKING)
    attainable = live.run_attainable(live.Case("looking", str(file)), 0.1)
    assert attainable is not None
    assert attainable > 0.0


def test_a_scenario_runs_to_its_end_or_for_as_long_as_is_asked(scenario):
    assert live.simulated_s(scenario, None) == 0.03
    assert live.simulated_s(scenario, 2.0) == 0.03
    assert live.simulated_s("teleop", None) == live.simulated_s("ros", None) == live.LONGEST_S
    assert live.simulated_s("teleop", 2.0) == 2.0


def test_every_scenario_has_a_row_or_a_reason():
    rows = live.cases([])
    assert {row.scenario for row in rows} | live.LEFT_OUT.keys() == set(live.installed_scenarios())
    kinds = [(row.apart, row.recorded) for row in rows if row.scenario == "palpation"]
    assert sorted(kinds) == [(False, False), (False, True), (True, False), (True, True)]


def test_the_table_is_redrawn_from_the_figures(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(live_table, "DOCS", tmp_path / "live.md")
    row = {
        f"{of}{name}": 1.25
        for of in ("", "bare_", "attainable_")
        for name in ("real_time_factor", "core_s_per_sim_s", "wall_ratio", "core_ratio")
    }
    unwatched = {**row, "attainable_real_time_factor": None}
    figures = {
        "whole": True,
        "runs": 3,
        "cores": 2,
        "load_begin": [1.0, 2.0, 3.0],
        "load_end": [4.0, 5.0, 6.0],
        "left_out": {"keys": "why"},
        "rows": [{"name": "short", "seconds": 2.0, **row}, {"name": "blind", "seconds": 20.0, **unwatched}],
    }
    (tmp_path / "live.json").write_text(json.dumps(figures))
    live_table.DOCS.write_text(f"before\n{live_table.BEGIN}\nold\n{live_table.END}\nafter\n")
    monkeypatch.setattr("sys.argv", ["live", "--input", str(tmp_path / "live.json"), "--docs"])
    live.main()
    page = live_table.DOCS.read_text()
    assert page.startswith("before\n")
    assert page.endswith(f"{live_table.END}\nafter\n")
    assert "| short | 2 | 1.25 | 1.25 | 1.25 | 1.25 | 1.25 | 1.250 | 1.250 |" in page
    assert "| blind | 20 | 1.25 |  | 1.25 |" in page
    assert "4.0 5.0 6.0 at the end" in page
    assert "old" not in page
    assert "| short |" in capsys.readouterr().out


def test_rows_of_some_scenarios_join_the_table():
    def result(whole, *names):
        numbers = ("real_time_factor", "bare_real_time_factor", "wall_ratio", "core_ratio")
        row = dict.fromkeys((*numbers, "seconds", "core_s_per_sim_s", "bare_core_s_per_sim_s"), 2.0 - whole)
        return {
            "whole": whole,
            "runs": 3,
            "cores": 2,
            "load_begin": (0.1, 0.2, 0.3),
            "load_end": (1.0, 1.0, 1.0),
            "left_out": {"keys": "a person"},
            "rows": [{"name": name, "attainable_real_time_factor": None, **row} for name in names],
        }

    page = redrawn("before\n<!-- bench/live.py --><!-- end -->\nafter\n", result(True, "a", "d", "p, apart"))
    for _ in range(2):  # the second time nothing is added
        page = redrawn(page, result(False, "d", "c"))
    rows = [line.split("|")[1:3] for line in page.splitlines() if line.startswith("|")][2:]
    assert rows == [[" a ", " 1 "], [" c ", " 2 "], [" d ", " 2 "], [" p, apart ", " 1 "]]
    facts = [line for line in page.splitlines() if line.startswith("- ")]
    how = "medians of 3 runs, load 0.1 0.2 0.3 at the begin, 1.0 1.0 1.0 at the end"
    assert facts == ["- 2 cores", f"- {how}", "- left out: `keys`: a person", f"- d: {how}", f"- c: {how}"]
    assert page.startswith("before\n")
    assert page.endswith("\nafter\n")
