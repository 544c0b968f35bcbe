"""How much stiffer than its tissue a mesh is, as `trocar organs` and a report tell it."""

import pytest
from typer.testing import CliRunner

from engines.bullet.probes.band import band
from engines.bullet.report_notes import notes
from engines.organ_commands import app
from engines.tissue.organs.params import OrganParams
from hub.recording.report_notes import participant_notes
from schemas.scenario import Scenario
from tests.engines.bullet.rig import BLOCK


def of_block(nodes, radius):
    return band(OrganParams.model_validate({**BLOCK, "nodes": nodes}), radius)


@pytest.mark.long
def test_a_finer_mesh_and_a_larger_sphere_need_less():
    coarse, fine = of_block(250, 5e-3), of_block(600, 5e-3)
    assert coarse.stiffer[1] > fine.stiffer[1] > 1.5
    assert of_block(250, 2e-3).stiffer[1] > coarse.stiffer[1]


def test_without_anchors_or_with_too_many_nodes_there_is_none():
    assert band(OrganParams.model_validate({**BLOCK, "anchors": []}), 5e-3) is None
    assert of_block(1500, 5e-3) is None


@pytest.mark.long
def test_trocar_organs_shows_it():
    shown = " ".join(CliRunner().invoke(app, []).output.split())
    assert "times too stiff under a sphere of 5 mm" in shown
    assert "does not relax" in shown


@pytest.mark.parametrize(
    ("probe", "said"),
    [
        ({}, "the force of tissue; the mesh alone is"),
        ({"spheres": 2}, "the force of the mesh, which is"),
    ],
)
def test_a_report_says_it_for_every_probe(probe, said):
    ((what, text),) = notes({"organs": {"block": BLOCK}, "probes": {"probe": probe}})
    assert what.startswith("probe on block, ")
    assert said in text


def test_a_report_opens_no_file_that_a_recording_names():
    ((_, text),) = notes({"organs": {"block": {"mesh": "/etc/passwd", "anchors": []}}})
    assert "from a file" in text


def test_what_cannot_be_told_is_a_row():
    tissue = {"kind": "bullet", "organs": {"block": {"size": "large"}}}
    scenario = Scenario.model_validate({"name": "s", "step": "1 ms", "participants": {"tissue": tissue}})
    ((name, _, text),) = participant_notes(scenario)
    assert name == "tissue"
    assert "ValidationError" in text
