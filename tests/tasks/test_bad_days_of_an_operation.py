"""Bad days of a cholecystectomy, run in the engine: consequence in the tissue, event, line on the card."""

import numpy as np
import pytest

from schemas.ros import StringMessage
from tests.tasks.theatre import BLADE, CLIPS, GRASPER, HEIGHTS, HOOK, Theatre, tube

DUCT, ARTERY, COMMON, GALLBLADDER = "cystic_duct", "cystic_artery", "common_bile_duct", "gallbladder"
pytestmark = pytest.mark.timeout(900)
HANDS = {"PSM1": CLIPS, "PSM3": BLADE}


@pytest.mark.long
def test_three_clips_and_a_cut_between_them_lose_nothing():
    with Theatre([DUCT], HANDS) as theatre:
        theatre.clip(DUCT, 6e-3, 16e-3, 20e-3).cut(DUCT, 11e-3)
        assert theatre.number(f"{DUCT}/blood/lost") < 0.02
        assert theatre.kinds.count("duct clipped") == theatre.kinds.count("duct cut") == 1
        assert theatre.metric("errors") == 0.0
        assert theatre.metric("duct/clips_that_stay") == 2.0
        assert theatre.metric("duct/clip3_from_gallbladder") == pytest.approx(20e-3, abs=1e-3)
        assert theatre.metric("duct/distance_from_common_duct") == pytest.approx(10e-3, abs=1e-3)
        assert theatre.metric("duct/cut_from_gallbladder") == pytest.approx(11e-3, abs=1.5e-3)
        assert theatre.metric("duct/cuff_patient") > 2e-3
        assert theatre.metric("duct/clip_tilt") < 0.1
        assert theatre.failure == ""


@pytest.mark.long
def test_a_duct_cut_without_a_clip_leaks_bile():
    with Theatre([DUCT], HANDS) as theatre:
        theatre.wait(0.05).cut(DUCT, 15e-3)
        assert "leaking" in theatre.tissue
        assert theatre.number(f"{DUCT}/blood/lost") > 0.5
        assert ("cut without clip", DUCT, "PSM3") in theatre.said
        assert theatre.metric("errors/cut_without_clip") == 1.0
        assert theatre.metric("bile_spilled") == theatre.number(f"{DUCT}/blood/lost")
        assert theatre.failure == "duct open"


@pytest.mark.long
def test_an_artery_cut_on_the_wrong_side_of_its_clips_bleeds():
    with Theatre([ARTERY], HANDS) as theatre:
        theatre.clip(ARTERY, 6e-3, 10e-3).cut(ARTERY, 20e-3)
        assert theatre.number(f"{ARTERY}/bleeding") > 0.0  # its supply is on the right
        assert ("cut beside clips", ARTERY, "PSM3") in theatre.said
        assert theatre.metric("errors/cut_beside_clips") == 1.0
        assert theatre.metric("blood_lost") == theatre.number(f"{ARTERY}/blood/lost") > 0.0
        assert theatre.metric("bleeding_grade") > 0.0
        assert theatre.failure == "artery open"


def test_a_clip_on_the_common_duct_shuts_it():
    with Theatre([DUCT, COMMON], HANDS) as theatre:
        theatre.clip(COMMON, 15e-3)
        assert theatre.outputs[f"{COMMON}/line"].shut.any()
        assert ("wrong structure clipped", COMMON, "PSM1") in theatre.said
        assert theatre.metric("errors/wrong_structure_clipped") == 1.0
        assert theatre.failure == "common duct injured"
        assert theatre.metric("duct/clips") == 0.0


@pytest.mark.long
def test_a_common_duct_that_is_cut_is_an_injury():
    with Theatre([DUCT, COMMON], HANDS) as theatre:
        theatre.wait(0.05).cut(COMMON, 15e-3)
        assert theatre.number(f"{COMMON}/blood/lost") > 0.0
        assert theatre.metric("errors/wrong_structure_hurt") == 1.0
        assert theatre.failure == "common duct injured"


@pytest.mark.long
def test_an_artery_that_is_pulled_too_far_tears_and_bleeds():
    weak = tube(ARTERY) | {"cutting": {"toughness": 3.0, "tear_stretch": 1.5}}
    with Theatre({ARTERY: weak}, {"PSM2": GRASPER}) as theatre:
        organ, z = theatre.engine._organs[0], HEIGHTS[ARTERY]
        theatre.put("PSM2", [[0.0, 0.0, z - 2e-3], [0.0, 0.0, z + 2e-3]]).wait(0.02)
        for node in np.flatnonzero(np.abs(organ.nodes[:, 0]) < 1.2e-3).tolist():
            organ.anchor(node, 0)
        theatre.lead("PSM2", theatre.at["PSM2"] + [0.02, 0.0, 0.0], 0.5).wait(0.6)
        assert "torn" in theatre.tissue
        assert theatre.number(f"{ARTERY}/blood/lost") > 0.0
        assert ("tube torn", ARTERY) in {(kind, place) for kind, place, _ in theatre.said}
        assert theatre.metric("errors/tube_torn") == 1.0
        assert theatre.metric(f"{ARTERY}/torn") > 0.0
        assert theatre.failure == "tube torn"
        assert np.isfinite(organ.nodes).all()


@pytest.mark.long
def test_a_gallbladder_that_is_slit_is_perforated():
    with Theatre([GALLBLADDER], HANDS) as theatre:
        theatre.wait(0.05).cut(GALLBLADDER, 15e-3, reach=0.4)
        assert "leaking" in theatre.tissue
        assert ("gallbladder perforated", GALLBLADDER, "") in theatre.said
        assert theatre.metric("errors/gallbladder_perforated") == theatre.metric("perforations") == 1.0
        assert theatre.metric("bile_spilled") > 0.0
        assert theatre.failure == "gallbladder perforated"


@pytest.mark.long
def test_a_clip_that_does_not_reach_across_does_not_hold():
    with Theatre([DUCT], HANDS) as theatre:
        theatre.clip(DUCT, 15e-3, aside=4.5e-3)
        assert theatre.tissue == ["clip not across"]
        assert not theatre.outputs[f"{DUCT}/line"].shut.any()
        assert ("clip not across", DUCT, "PSM1") in theatre.said
        assert theatre.metric("errors/clip_not_across") == theatre.metric("duct/clips_slipped") == 1.0
        theatre.cut(DUCT, 15e-3)
        assert theatre.failure == "duct open"


def test_a_clip_too_near_the_common_duct_and_another_clip():
    with Theatre([DUCT], HANDS) as theatre:
        theatre.clip(DUCT, 10e-3, 11e-3, 27e-3)
        assert theatre.metric("errors/clip_too_near") == 2.0
        assert theatre.metric("duct/distance_from_common_duct") < 5e-3


def test_an_instrument_that_is_exchanged_while_it_holds_tears_loose():
    block = {
        "size": ["16 mm", "12 mm", "8 mm"],
        "young_modulus": "20 kPa",
        "nodes": 75,
        "position": [0, 0, 0],
    }
    grasper = GRASPER | {"grasp": {"hold": "0.4 N", "reach": "3 mm"}}
    with Theatre({GALLBLADDER: block}, {"PSM2": grasper}) as theatre:
        theatre.put("PSM2", [[-3e-3, 0.0, 1.0e-3], [3e-3, 0.0, 1.0e-3]]).wait(0.02)
        theatre.lead("PSM2", [[-1.6e-3, 0.0, 0.5e-3], [1.6e-3, 0.0, 0.5e-3]], 0.3)
        assert ("gallbladder grasped", GALLBLADDER, "PSM2") in theatre.said
        theatre.driver.send("PSM2/set_tool_type", StringMessage(data="PROGRASP_FORCEPS:400093"))
        theatre.lead("PSM2", theatre.at["PSM2"] + [0.0, 0.0, 0.03], 0.5)
        assert "torn" in theatre.tissue
        assert theatre.number("PSM2/held") == 0.0
        assert ("exchanged while holding", "", "PSM2") in theatre.said
        assert ("grasp torn off", GALLBLADDER, "PSM2") in theatre.said
        assert theatre.metric("errors/exchanged_while_holding") == 1.0
        assert theatre.metric("PSM2/grasps_torn_off") == 1.0
        assert theatre.metric("PSM2/peak_pull") > 0.3


@pytest.mark.parametrize(
    ("beside", "kind"), [(False, "energy in the air"), (True, "energy on an instrument")]
)
def test_power_without_tissue_heats_nothing(beside, kind):
    with Theatre([DUCT], {"PSM1": HOOK}) as theatre:
        theatre.wait(0.05)
        if beside:
            theatre.driver.set("PSM2/measured_cp", [0.005, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        theatre.values["PSM1/energy"][:] = 30.0
        theatre.wait(0.5)
        assert theatre.number("PSM1/delivered") == 0.0
        assert theatre.number(f"{DUCT}/hottest") == 37.0
        assert (kind, "", "PSM1") in theatre.said
        assert theatre.metric(f"errors/{kind.replace(' ', '_')}") == 1.0
        assert theatre.metric("PSM1/idle_energy") == pytest.approx(15.0, rel=0.1)


@pytest.mark.long
def test_a_burnt_common_duct_is_an_injury_with_its_temperature():
    with Theatre([DUCT, COMMON], {"PSM1": HOOK}) as theatre:
        z = HEIGHTS[COMMON]
        theatre.put("PSM1", [[0.0, 0.0, z + 2.6e-3]]).wait(0.02)
        theatre.values["PSM1/energy"][:] = 30.0
        theatre.wait(1.2)
        assert "burnt" in theatre.tissue
        assert theatre.metric("errors/wrong_structure_hurt") == 1.0
        assert theatre.metric(f"{COMMON}/hottest") > 60.0
        assert theatre.metric(f"{COMMON}/burnt") > 0.0
        assert theatre.metric(f"{DUCT}/burn_distance") == pytest.approx(z, abs=5e-3)
        assert theatre.metric("PSM1/idle_energy") < 1.0
        assert theatre.failure == "common duct injured"
