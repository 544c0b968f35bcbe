"""The cholecystectomy task with tissue that reports what it is told to: goals, errors, card."""

from math import isfinite

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hub.testing import Driver, check_engine
from schemas.ros import Header, Point
from schemas.trocar_msgs import SoftBodyState, TissueEvent, TissueGrasp, TubeEvent, TubeLine
from tasks.cholecystectomy.organs import ORGANS
from tasks.cholecystectomy.outcome import FAILURES
from tasks.cholecystectomy.params import CholecystectomyParams
from tasks.cholecystectomy.task import CholecystectomyTask
from tasks.rules.operation_errors import ERRORS

PERIOD_NS = 10_000_000
UPRIGHT = [1.0, 0.0, 0.0, 0.0]  # the tip looks down
ARMS = {
    "PSM1": {"position": [0.06, 0.0, 0.2]},
    "PSM2": {"position": [-0.06, 0.0, 0.2]},
    "ECM": {"position": [0.0, -0.1, 0.2]},
}
LENGTH, RINGS = 0.03, 31
HEIGHTS = {"cystic_duct": 0.0, "cystic_artery": 0.01, "common_bile_duct": 0.02, "hepatic_artery": 0.03}


def operation(**changes):
    return CholecystectomyTask("task", CholecystectomyParams.model_validate({"arms": ARMS} | changes))


def line(organ, parted=()):
    """A tube along x at the height of the organ, parted after these rings."""
    x = np.linspace(0.0, LENGTH, RINGS)
    flags = np.zeros(RINGS, np.uint8)
    flags[list(parted)] = 1
    points = np.column_stack([x, np.zeros(RINGS), np.full(RINGS, HEIGHTS[organ])])
    return TubeLine(
        header=Header(frame_id="world"),
        body=organ,
        points_m=points.ravel(),
        along_m=x,
        areas_m2=np.full(RINGS, 1e-6),
        diameters_m=np.full(RINGS, 4e-3),
        shut=np.zeros(RINGS, np.uint8),
        parted=flags,
    )


def event(kind, x=0.0, z=0.0, instrument="PSM1", size=1.2e-3, unit="m"):
    at = Point(x=x, y=0.0, z=z)
    return TissueEvent(header=Header(), kind=kind, instrument=instrument, position=at, size=size, unit=unit)


def tube_event(kind, organ, x=0.0, **more):
    at = Point(x=x, y=0.0, z=HEIGHTS[organ])
    more = {"instrument": "PSM1"} | more
    return TubeEvent(header=Header(), kind=kind, body=organ, position=at, along_m=x, **more)


class Operation:
    """A task whose tissue is the test's."""

    def __init__(self, without=(), **changes):
        self.task = operation(**changes)
        ports = {port.name: port for port in self.task.ports if port.causality == "input"}
        signals = {
            name: port for name, port in ports.items() if port.variability == "signal" and name not in without
        }
        given = {
            name: [0.0] * 6 + [1.0] if port.type.endswith("PoseStamped") else list(port.start)
            for name, port in signals.items()
            if port.start != ()
        }
        for arm in ("PSM1", "PSM2"):
            given[f"{arm}/measured_cp"] = [0.0, 0.0, 0.0, *UPRIGHT]
        given["PSM2/measured_cp"][0] = 0.2
        given |= {f"tissue/{organ}/line": line(organ) for organ in HEIGHTS}
        self.known = set(ports) - set(without)
        given = {name: value for name, value in given.items() if name in self.known}
        self.driver = Driver(self.task, period_ns=PERIOD_NS, inputs=given)
        # event ports count as connected too
        self.task._seen.connect(frozenset(self.known))
        self.said, self.clips = [], -1

    def set(self, **values):
        for name, value in values.items():
            self.driver.set(name, value)
        return self

    def report(self, organ, *events):
        self.driver.send(f"tissue/{organ}/events", *events)
        return self.wait(0.01)

    def wait(self, seconds):
        self.driver.step(round(seconds * 1e9 / PERIOD_NS))
        self.said += [(one.event, one.place, one.arm) for one in self.driver.sent.get("events", ())]
        return self

    def grasp(self):
        self.driver.send(
            "tissue/PSM2/events",
            TissueGrasp(header=Header(), event="grasped", body="gallbladder", force_n=0.0),
        )
        self.driver.set("tissue/PSM2/held", [1.0])
        return self.wait(0.05)

    def clip(self, organ, *places, **more):
        for x in places:
            self.clips += 1
            self.driver.send(f"tissue/{organ}/tube", tube_event("clipped", organ, x, clip=self.clips, **more))
            self.report(organ, event("clipped", x, HEIGHTS[organ])).wait(0.05)
        return self

    def tube(self, organ, kind, x=0.0, **more):
        self.driver.send(f"tissue/{organ}/tube", tube_event(kind, organ, x, **more))
        return self.wait(0.05)

    def cut(self, organ, x):
        self.driver.set(f"tissue/{organ}/line", line(organ, parted=[round(1e3 * x)]))
        return self.tube(organ, "parted", x, instrument="PSM2", cause="cut")

    @property
    def kinds(self):
        return [kind for kind, _, _ in self.said]

    @property
    def errors(self):
        return [kind for kind in self.kinds if kind in ERRORS]

    @property
    def card(self):
        card = self.task.card(self.driver.time_ns)
        values = [*card.metrics, *(value for rules in card.rules for value in rules.values)]
        assert all(isfinite(value.value) for value in values)
        assert all(value.reason == "" or value.value == 0.0 or value.reason for value in values)
        return card

    def metric(self, name):
        value = {one.name: one for one in self.card.metrics}[name]
        return value.reason or value.value

    def rule(self, rules, name):
        found = next(one.values for one in self.card.rules if one.rules == rules)
        value = next(one for one in found if one.name == name)
        return value.reason or value.value

    @property
    def failure(self):
        number = int(self.driver["failure"][0])
        return FAILURES[number - 1] if number else ""

    @property
    def success(self):
        return self.driver["success"][0] == 1.0


def inputs_of(task):
    kinds = {
        "PoseStamped": [0.01, 0.02, 0.03, 0.0, 0.0, 0.0, 1.0],
        "WrenchStamped": [1.0, 2.0, 2.0, 0.0, 0.0, 0.0],
        "TissueEvent": (event("clipped", 0.01),),
        "TissueGrasp": (TissueGrasp(header=Header(), event="grasped", body="gallbladder", force_n=1.0),),
        "TubeLine": line("cystic_duct"),
        "TubeEvent": (tube_event("clipped", "cystic_duct", 0.01, clip=0),),
        "SoftBodyState": SoftBodyState(
            header=Header(), body="liver", nodes_m=np.zeros(3, np.float32), triangles=np.zeros(0, np.uint32)
        ),
    }
    found = {}
    for port in task.ports:
        if port.causality == "input" and port.type.rpartition("/")[2] != "Bool":
            found[port.name] = kinds.get(port.type.rpartition("/")[2], [1.0] * port.size)
    return found


def test_it_keeps_the_contract():
    check_engine(operation, period_ns=PERIOD_NS, inputs=inputs_of(operation()))


def whole():
    """A trial in which all is done well."""
    trial = Operation().wait(0.05).grasp()
    trial.clip("cystic_duct", 4e-3, 9e-3, 13e-3).cut("cystic_duct", 6.5e-3)
    return trial.clip("cystic_artery", 4e-3, 9e-3, 13e-3).cut("cystic_artery", 6.5e-3).wait(0.1)


def test_clips_and_cuts_reach_the_goals():
    trial = whole()
    assert [kind for kind in trial.kinds if kind not in ("clip closed", "phase")] == [
        "gallbladder grasped",
        "duct clipped",
        "duct cut",
        "artery clipped",
        "artery cut",
    ]
    assert (trial.card.reached, trial.card.goals, trial.success, trial.failure) == (5, 5, True, "")
    assert trial.driver["done"][0] == 1.0
    assert trial.metric("duct/clips") == 3.0
    assert trial.metric("duct/clip1_from_gallbladder") == pytest.approx(4e-3)
    assert trial.metric("duct/clip_distance") == pytest.approx(4e-3)
    assert trial.metric("duct/distance_from_common_duct") == pytest.approx(17e-3)
    assert trial.metric("duct/cut_from_gallbladder") == pytest.approx(6.5e-3)
    assert trial.metric("duct/cuff_patient") == pytest.approx(2.5e-3 - 0.6e-3)
    assert trial.metric("duct/clips_that_stay") == 2.0
    assert trial.metric("duct/clip_tilt") == pytest.approx(0.0, abs=1e-6)
    assert trial.metric("errors") == 0.0
    assert trial.rule("ochra", "errors") == 0.0
    places = [place for kind, place, _ in trial.said if kind == "phase"]
    assert places == ["calot-triangle-dissection", "clipping-and-cutting", "gallbladder-dissection"]
    assert trial.metric("phase/clipping-and-cutting") > 0.3
    assert "specimen bag" in trial.metric("phase/gallbladder-packaging")


@pytest.mark.parametrize(
    ("clips", "cut", "error", "failure"),
    [
        ((), 6.5e-3, "cut without clip", "duct open"),
        ((4e-3,), 6.5e-3, "cut beside clips", "duct open"),
        ((13e-3, 17e-3, 21e-3), 6.5e-3, "cut beside clips", ""),
        ((4e-3, 13e-3), 6.5e-3, "cut with too few clips", "clips missing"),
        ((4e-3, 9e-3, 13e-3), 5e-3, "cut with short cuff", ""),
    ],
)
def test_a_cut_at_a_wrong_place_is_an_error(clips, cut, error, failure):
    trial = Operation().wait(0.05).clip("cystic_duct", *clips).cut("cystic_duct", cut)
    assert trial.errors == [error]
    assert (error, "cystic_duct", "PSM2") in trial.said
    assert trial.failure == failure
    assert not trial.success
    assert trial.metric(f"errors/{error.replace(' ', '_')}") == 1.0
    assert trial.rule("ochra", ERRORS[error].mode) == 1.0


def test_a_clip_on_the_common_duct_is_an_injury():
    trial = Operation().clip("common_bile_duct", 10e-3)
    assert ("wrong structure clipped", "common_bile_duct", "PSM1") in trial.said
    assert trial.failure == "common duct injured"
    assert trial.metric("failed/common_duct_injured") == trial.metric("failed/not_finished") == 1.0
    whole_one = whole().clip("common_bile_duct", 10e-3)
    assert not whole_one.success  # also after the last goal


def test_a_tube_that_parts_without_an_edge_has_torn():
    trial = Operation().wait(0.05).tube("cystic_artery", "parted", 10e-3, instrument="PSM2", cause="torn")
    assert trial.errors == ["tube torn"]
    assert trial.failure == "tube torn"
    trial.report("cystic_artery", event("torn", 10e-3, 0.01, "PSM2", 1e-5, "m^2"))
    assert trial.metric("errors/tube_torn") == 1.0  # the same tear, reported later
    assert trial.metric("cystic_artery/torn") == 1e-5
    avulsed = Operation().set(**{"tissue/artery_origin/freed": [1e-6]}).wait(0.05)
    assert (avulsed.errors, avulsed.metric("avulsions")) == (["tube torn"], 1.0)
    burnt = Operation().wait(0.05).tube("cystic_duct", "parted", 10e-3, cause="burnt")
    assert burnt.errors == ["cut without clip"]


def test_clips_that_are_oblique_crowded_slipped_or_pulled_off():
    trial = Operation().wait(0.05)
    along = [0.0, 0.5**0.5, 0.0, 0.5**0.5]
    trial.driver.set("PSM1/measured_cp", [0.0, 0.0, 0.0, *along])
    trial.clip("cystic_duct", 9e-3, 10e-3, 28e-3)
    near, oblique = "clip too near", "clip oblique"
    assert trial.errors == [oblique, near, oblique, near, oblique]
    assert trial.metric("duct/clip_tilt") == pytest.approx(np.pi / 2)
    trial = Operation().clip("cystic_duct", 4e-3, 9e-3).clip("cystic_artery", 9e-3, others=["cystic_duct"])
    trial.tube("cystic_duct", "clip slipped").tube("cystic_duct", "clip not across")
    trial.tube("cystic_duct", "clip pulled off", 9e-3, clip=1)
    assert trial.errors == ["clip across two", "clip slipped", "clip not across", "clip pulled off"]
    assert trial.metric("duct/clips") == 1.0
    assert trial.metric("duct/clip1_from_gallbladder") == pytest.approx(4e-3)


def test_power_in_the_air_and_on_an_instrument():
    trial = Operation().wait(0.1).set(**{"PSM1/energy": [30.0]}).wait(0.5)
    assert trial.errors == ["energy in the air"]
    assert trial.metric("PSM1/idle_energy") == pytest.approx(15.0, rel=0.05)
    assert trial.metric("PSM1/blind_activations") == 1.0
    trial.set(**{"PSM1/energy": [0.0]}).wait(0.05)
    trial.set(**{"PSM1/energy": [30.0], "PSM2/measured_cp": [0.125, 0.0, 0.0, *UPRIGHT]}).wait(0.5)
    assert trial.errors[1:] == ["energy on an instrument"]
    assert trial.metric("PSM1/activations") == 2.0
    hot = Operation().wait(0.1).set(**{"PSM1/energy": [30.0]})
    for heat in range(40):
        hot.set(**{"tissue/PSM1/delivered": [0.3 * heat + 0.1]}).wait(0.01)
    assert hot.errors == []
    assert hot.metric("PSM1/idle_energy") == 0.0


def test_a_perforated_gallbladder_spills_bile():
    trial = Operation().report("gallbladder", event("leaking", size=0.5, unit="ml/s"))
    trial.set(**{"tissue/gallbladder/blood/lost": [3.0], "tissue/liver/blood/lost": [2.0]}).wait(0.05)
    assert trial.errors == ["gallbladder perforated"]
    assert trial.failure == "gallbladder perforated"
    assert (trial.metric("bile_spilled"), trial.metric("blood_lost")) == (3.0, 2.0)


def test_burns_are_measured_from_what_is_to_be_spared():
    trial = Operation(without=("tissue/liver/nodes", "tissue/duodenum/nodes"))
    trial.report("gallbladder", event("burnt", 15e-3, 0.025, size=1e-9, unit="m^3")).wait(0.05)
    assert trial.errors == []
    assert trial.metric("common_bile_duct/burn_distance") == pytest.approx(5e-3)
    trial.report("duodenum", event("burnt", size=2e-9, unit="m^3"))
    trial.report("duodenum", event("burnt", size=2e-9, unit="m^3"))
    assert trial.errors == ["wrong structure hurt"]  # one burn that lasts
    assert trial.failure == "bowel injured"
    assert trial.metric("duodenum/burnt") == 4e-9
    bleeding = (
        Operation().set(**{"tissue/liver/blood/lost": [60.0], "tissue/liver/bleeding": [0.5]}).wait(0.05)
    )
    assert bleeding.failure == "bleeding"
    assert bleeding.metric("bleeding_grade") == 3.0


def test_the_critical_view_comes_from_the_state():
    trial = Operation(without=("tissue/fat/events",)).wait(0.05)
    assert trial.metric("cvs/structures") == 2.0
    assert trial.metric("cvs/triangle_cleared") == 1.0  # there is no fat
    assert trial.rule("cvs-doublet", "total") == 4.0
    trial.set(**{"tissue/cystic_plate/lower_third": [1.0]}).wait(0.05)
    assert (trial.rule("cvs-doublet", "total"), trial.rule("cvs-doublet", "satisfactory")) == (6.0, 1.0)
    trial.clip("cystic_duct", 5e-3)
    assert trial.metric("cvs/met_at_first_clip") == 3.0
    trial.cut("cystic_duct", 8e-3)
    assert trial.metric("cvs/structures") == trial.rule("cvs-doublet", "two_structures") == 2.0
    dissection = Operation(phase="calot-dissection")
    shares = {
        "tissue/cystic_plate/lower_third": [0.95],
        "tissue/fat_gallbladder/freed": [0.95],
        "tissue/fat_gallbladder/tied": [0.05],
    }
    dissection.set(**shares).wait(0.05)
    assert dissection.kinds == ["triangle cleared", "plate opened"]
    assert dissection.success
    bed = Operation(phase="gallbladder-bed").set(**{"tissue/cystic_plate/freed": [1e-3]}).wait(0.05)
    assert (bed.kinds[0], bed.success) == ("gallbladder freed", True)


def test_without_tissue_the_card_says_what_is_missing():
    signals = [port.name for port in operation().ports if "tissue/" in port.name or "/energy" in port.name]
    trial = Operation(without=signals).wait(0.2)
    for name in ("duct/clips", "blood_lost", "cvs/structures", "cvs/plate_freed", "PSM1/idle_energy"):
        assert "connect" in trial.metric(name), name
    assert trial.rule("goals", "autonomy").startswith("an observer's mark")
    assert not trial.success


def test_numbers_that_are_none_do_not_reach_the_card():
    trial = Operation()
    broken = line("cystic_duct").model_copy(update={"points_m": np.full(3 * RINGS, np.nan)})
    trial.set(**{"tissue/cystic_duct/line": broken}).wait(0.05)
    trial.clip("cystic_duct", 5e-3)
    assert trial.card is not None
    for rows in (np.zeros(0), np.zeros(1)):
        trial.set(**{"tissue/cystic_duct/line": broken.model_copy(update={"along_m": rows})}).wait(0.02)
    for _ in range(40):  # more clips than anyone has
        trial.clip("cystic_duct", 5e-3)
    assert trial.card is not None


def test_more_clips_stay_than_there_are():
    with pytest.raises(ValidationError, match="stays: 4 of 3 clips cannot stay with the patient"):
        operation(stays=4)


TISSUE_KINDS = ("cut", "torn", "burnt", "detached", "bleeding", "leaking", "clipped", "unheard of")
TUBE_KINDS = ("clipped", "clip slipped", "clip not across", "clip pulled off", "parted", "unheard of")


@given(
    st.lists(
        st.tuples(
            st.sampled_from(ORGANS),
            st.sampled_from(TISSUE_KINDS),
            st.sampled_from(TUBE_KINDS),
            st.sampled_from(["cut", "torn", "burnt", ""]),
            st.sampled_from(["PSM1", "PSM2", "", "nobody"]),
            st.floats(-0.1, 0.1),
            st.integers(-1, 40),
        ),
        max_size=30,
    )
)
def test_any_order_of_events_leaves_a_card_of_numbers(happened):
    trial = Operation()
    for organ, kind, tube, cause, instrument, along, clip in happened:
        trial.driver.send(f"tissue/{organ}/events", event(kind, along, 0.0, instrument))
        if organ in HEIGHTS:
            more = {"cause": cause, "instrument": instrument, "clip": clip, "others": [organ]}
            trial.driver.send(f"tissue/{organ}/tube", tube_event(tube, organ, along, **more))
        trial.wait(0.02)
    assert trial.card.goals == 5
    assert trial.metric("errors") == sum(kind in ERRORS for kind in trial.kinds)
