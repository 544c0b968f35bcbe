"""Contacts between instruments and organs: made from `touches`, or said to be missing."""

import numpy as np
import pytest

import trocar
from hub.planning.contacts import missing_contacts
from hub.planning.scenario_file import installed_scenarios, load
from robots import rotation
from robots.dvrk.end_effectors.electrode import Electrode
from robots.dvrk.instruments import instrument
from schemas.errors import ScenarioError, SessionError

TOUCHES = """\
name: touching
step: 1 ms
duration: 30 ms
scene:
  looks: false
  arms:
    PSM1: {position: [0 mm, 0 mm, 112 mm], touches: [liver]}
participants:
  robot: {kind: mujoco}
  tissue:
    kind: bullet
    organs: {liver: {size: [60 mm, 60 mm, 15 mm], young_modulus: 5 kPa, nodes: 100, damping: 0.25 ms}}
"""
BY_HAND = (
    TOUCHES.replace(", touches: [liver]", "")
    + """\
    probes: {PSM1: {radius: 5 mm}}
bonds:
  - {motion: robot.PSM1/probe, force: tissue.PSM1}
"""
)


@pytest.fixture
def write(tmp_path):
    def write(text, name="touching.yaml"):
        file = tmp_path / name
        file.write_text(text)
        return str(file)

    return write


def test_touches_is_short_for_a_probe_and_a_bond(write, tmp_path):
    short, long = write(TOUCHES), write(BY_HAND, "long.yaml")
    assert load(short).scenario.bonds == load(long).scenario.bonds
    assert load(short).params["tissue"] == load(long).params["tissue"]
    summary = trocar.run(short, record=tmp_path / "kept")
    assert summary.state_hash == trocar.run(long).state_hash
    assert trocar.verify(tmp_path / "kept").same


def test_a_jaw_may_grasp_and_has_the_numbers_of_the_scenario_too(write):
    overrides = [
        "scene.arms.PSM1.instrument=CADIERE_FORCEPS_400049",
        "participants.tissue.probes={PSM1: {stiffness: 900}}",
    ]
    file = load(write(TOUCHES), overrides)
    (probe,) = file.params["tissue"].probes.values()
    assert (probe.spheres, probe.stiffness, probe.grasp.fingers) == (6, 900, 2)
    assert [str(bond.motion) for bond in file.scenario.bonds] == ["robot.PSM1/contact"]


def test_a_scenario_with_its_contacts_made_gets_no_more(write):
    made = load(write(TOUCHES)).scenario
    again = load(write(made.model_dump_json(), "again.yaml"))
    assert again.scenario.bonds == made.bonds


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (
            "scene.arms.PSM1.touches=[livre]",
            "PSM1.touches: there is no organ 'livre'.*'liver'",
        ),
    ],
)
def test_a_contact_that_cannot_be_made_is_refused(write, change, problem):
    with pytest.raises(ScenarioError, match=problem):
        load(write(TOUCHES), [change])


def test_an_instrument_without_spheres_touches_nothing(write, monkeypatch):
    monkeypatch.setattr(Electrode, "spheres", lambda self, tip: ())
    instrument("400184").__dict__.pop("spheres", None)
    with pytest.raises(ScenarioError, match="has no contact spheres"):
        load(write(TOUCHES), ["scene.arms.PSM1.instrument=PERMANENT_CAUTERY_SPATULA_400184"])
    instrument("400184").__dict__.pop("spheres", None)


@pytest.mark.parametrize(
    ("number", "mode", "spheres", "bare"),
    [("400183", "monopolar", 10, 3), ("400179", "monopolar", 5, None), ("400172", "bipolar", 8, None)],
)
def test_an_energy_instrument_heats_tissue_of_our_own_without_a_word(write, number, mode, spheres, bare):
    change = [f"scene.arms.PSM1.instrument='{number}'"]
    fem = load(write(TOUCHES), [*change, "participants.tissue.kind=fem"])
    (probe,) = fem.params["tissue"].probes.values()
    assert (probe.energy.mode, probe.spheres, probe.energy.bare) == (mode, spheres, bare)
    (probe,) = load(write(TOUCHES), change).params["tissue"].probes.values()
    assert probe.energy is None, "tissue in Bullet knows no heat"
    cold = [*change, "participants.tissue.kind=fem", "participants.tissue.probes={PSM1: {energy: null}}"]
    (probe,) = load(write(TOUCHES), cold).params["tissue"].probes.values()
    assert probe.energy is None


def test_a_clip_applier_brings_its_clip_to_tissue_of_our_own(write):
    change = ["scene.arms.PSM1.instrument='420327'"]
    (probe,) = (
        load(write(TOUCHES), [*change, "participants.tissue.kind=fem"]).params["tissue"].probes.values()
    )
    assert probe.clip.diameters == (3.5e-3, 7e-3)
    assert probe.grasp is not None
    (probe,) = load(write(TOUCHES), change).params["tissue"].probes.values()
    assert probe.clip is None


def test_spare_instruments_bring_a_probe_each_to_tissue_that_bears_an_exchange(write):
    change = ["scene.arms.PSM1.instrument='400230'", "scene.arms.PSM1.spares=[400183, SUCTION_IRRIGATOR]"]
    with pytest.raises(ScenarioError, match="take kind fem"):
        load(write(TOUCHES), [*change[:1], "scene.arms.PSM1.spares=[400183]"])
    liver = "participants.tissue.organs.liver"
    change += [f"{liver}.cutting={{toughness: 50 J/m^2}}", f"{liver}.bleeding={{}}"]
    file = load(write(TOUCHES), [*change, "participants.tissue.kind=fem"])
    probes = file.params["tissue"].probes
    assert list(probes) == ["PSM1", "PSM1_PERMANENT_CAUTERY_HOOK_400183", "PSM1_SUCTION_IRRIGATOR"]
    applier, hook, irrigator = probes.values()
    assert applier.clip is not None
    assert hook.energy.mode == "monopolar"
    assert irrigator.suction is not None
    assert irrigator.irrigation is not None
    assert [str(bond.motion) for bond in file.scenario.bonds] == [
        "robot.PSM1/contact",
        "robot.PSM1/PERMANENT_CAUTERY_HOOK_400183/contact",
        "robot.PSM1/SUCTION_IRRIGATOR/contact",
    ]


def test_an_instrument_that_passes_through_is_named_with_lines_to_add(write):
    text = TOUCHES.replace(", touches: [liver]", "")
    file = load(write(text))
    (missing,) = missing_contacts(file.params, file.scenario.bonds)
    assert missing.remedy.endswith("scene:\n  arms:\n    PSM1: {touches: [liver]}")
    far = load(write(text), ["scene.arms.PSM1.position=[0, 0, 400 mm]"])
    assert not missing_contacts(far.params, far.scenario.bonds)
    (cart,) = (load(write(TOUCHES), ["scene.mounting=cart", "scene.arms={PSM2: {}}"]),)
    assert not missing_contacts(cart.params, cart.scenario.bonds)


@pytest.mark.parametrize("name", installed_scenarios())
def test_no_installed_scenario_has_an_instrument_that_passes_through(name):
    file = load(name)
    assert not missing_contacts(file.params, file.scenario.bonds)


def test_a_run_says_once_that_an_instrument_is_inside_an_organ(write, caplog):
    trocar.run(write(TOUCHES.replace(", touches: [liver]", "")))
    (said,) = [one.message for one in caplog.records if "inside 'liver'" in one.message]
    assert "PSM1: {touches: [liver]}" in said
    caplog.clear()
    trocar.run(write(TOUCHES))
    trocar.run(write(TOUCHES.replace(", touches: [liver]", "").replace("112 mm]", "135 mm]")))
    assert "inside" not in caplog.text


def test_spheres_at_the_tip_are_the_models(write):
    start = "[0.1, -0.2, 150 mm, 0.3, -0.4, 0.5]"
    overrides = [
        "scene.arms.PSM1.instrument=CADIERE_FORCEPS_400049",
        f"scene.arms.PSM1.start={start}",
        "scene.arms.PSM1.position=[0, 0, 300 mm]",
    ]
    file = load(write(TOUCHES), overrides)
    (tool,) = file.params["robot"].tools
    with trocar.SteppedSession(file) as session:
        tip = session["robot.PSM1/measured_cp"]
        with pytest.raises(SessionError, match="has messages, without names"):
            session.read("tissue.liver/nodes")
        there = session["robot.PSM1/contact/position"].reshape(-1, 3)
    expected = tool.spheres @ rotation.matrix(tip[3:]).T + tip[:3] + tool.base[:3, 3]
    assert np.abs(there - expected).max() < 1e-4
    assert np.linalg.norm(there - tool.base[:3, 3], axis=1).max() < tool.reach
