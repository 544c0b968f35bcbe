"""The pad as a participant: the contract, what it refuses, events, and a needle of MuJoCo that it holds."""

from math import acos, pi

import numpy as np
import pytest
from pydantic import ValidationError

from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from engines.suture_pad.engine import SuturePad
from engines.suture_pad.params import SuturePadParams
from engines.suture_pad.skin import Skin
from hub.participant import BondPlan, Inputs, Setup
from hub.testing import check_engine
from robots import rotation
from robots.training.needles import NEEDLES
from robots.training.phantoms import PHANTOMS
from schemas.errors import ScenarioError, SessionError, StateError

MS = 1_000_000
NEEDLE = NEEDLES["sh-plus"]
SCENE = {
    "fixtures": {"phantom": {"kind": "phantom", "phantom": "branch-top", "position": [0.0, 0.0, 0.0]}},
    "objects": {"needle": {"kind": "needle", "position": [0.0, 0.0, 0.05]}},
}
IMPULSE = BondPlan(prediction="velocity", mean=True)


def pad(**changes):
    return SuturePad("pad", SuturePadParams.model_validate(SCENE | changes))


def needle_at(angle, row=0, needle=NEEDLE):
    """Base, middle and tip of a needle on its way through a pair of holes, with its tip at an angle."""
    x, y = PHANTOMS["branch-top"].entries[row, :2, 3]
    height = (needle.radius**2 - x**2) ** 0.5
    turn = angle - needle.arc / 2
    axes = np.array([[np.cos(turn), -np.sin(turn), 0], [0, 0, 1], [-np.sin(turn), -np.cos(turn), 0]])
    return needle.bond_points @ axes.T + [0.0, y, height]


def driven(engine, angles, row=0):
    """Move the needle through the pad at one period each, and return the outputs."""
    found, before = [], needle_at(angles[0], row)
    for i, angle in enumerate(angles):
        now = needle_at(angle, row)
        values = {"needle/position": now.ravel(), "needle/velocity": (now - before).ravel() / 1e-3}
        out = engine.step(i * MS, MS, Inputs(values))
        found.append(
            {name: np.copy(value) if isinstance(value, np.ndarray) else value for name, value in out.items()}
        )
        before = now
    return found


ENTRY = pi / 2 - acos((NEEDLE.radius**2 - 8e-3**2) ** 0.5 / NEEDLE.radius)


def test_it_keeps_the_contract():
    inputs = {
        "needle/position": needle_at(ENTRY + 0.2).ravel(),
        "needle/velocity": np.tile([0.0, 0.0, -0.01], 3),
    }
    check_engine(pad, period_ns=MS, inputs=inputs)


def with_thread(**changes):
    needle = SCENE["objects"]["needle"] | {"thread": {"length": 0.08, "segments": 32}}
    return pad(objects={"needle": needle}, **changes)


def test_with_a_thread_it_keeps_the_contract_too():
    inputs = {
        "needle/position": needle_at(ENTRY + 0.2).ravel(),
        "needle/velocity": np.tile([0.0, 0.0, -0.01], 3),
    }
    check_engine(with_thread, period_ns=MS, inputs=inputs)
    assert not [port.name for port in pad().ports if "thread" in port.name or port.name == "passages"]


@pytest.mark.long
def test_the_needle_draws_its_thread_into_its_channel_and_feels_it():
    engine = with_thread(node_period="1 ms")
    first = engine.configure(Setup(MS, None, {"needle": IMPULSE}))["thread/nodes"]
    assert first.triangles.max() == len(first.nodes_m) // 3 - 1
    out = driven(engine, np.arange(ENTRY - 0.1, 2 * pi + 0.6, 0.01), row=2)
    events = {event.event: i for i, row in enumerate(out) for event in row["events"]}
    assert out[events["exited"]]["passages"][0] == 0.0
    pulled_out = out[events["pulled out"]]
    assert (pulled_out["passages"][0], out[-1]["passages"][0]) == (1.0, 1.0)
    bite = 2.0 * NEEDLE.radius * acos((NEEDLE.radius**2 - 8e-3**2) ** 0.5 / NEEDLE.radius)
    assert out[-1]["thread_pull"][0] == pytest.approx(10.0 * bite, rel=0.05)
    # the needle goes on turning about the arc's centre, with the thread behind its base
    force = out[-1]["needle/force"].reshape(3, 3).sum(axis=0)
    exit_hole = PHANTOMS["branch-top"].exits[2, :3, 3]
    way = exit_hole - needle_at(2 * pi + 0.6, 2)[0]
    assert force @ way / np.linalg.norm(way) == pytest.approx(out[-1]["thread_pull"][0], rel=0.05)
    centres = out[-1]["thread/nodes"].nodes_m.reshape(33, -1, 3).mean(axis=1)
    inside = centres[:, 2] < -0.1e-3
    assert inside.sum() >= 5
    assert centres[inside, 1] == pytest.approx(exit_hole[1], abs=0.1e-3)
    lengths = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    assert lengths.max() < 1.01 * 2.5e-3


def test_events_name_the_holes_and_outputs_say_where_and_how_deep():
    engine = pad()
    engine.configure(Setup(MS, None, {"needle": IMPULSE}))
    out = driven(engine, np.arange(ENTRY - 0.1, 2 * pi + 0.4, 0.01), row=2)
    events = [(event.event, event.place) for row in out for event in row["events"]]
    assert events == [("entered", "entry3"), ("exited", "exit3"), ("pulled out", "exit3")]
    assert out[-1]["stitches"][0] == 1.0
    depth = max(row["depth"][0] for row in out)
    assert depth == pytest.approx(NEEDLE.radius - (NEEDLE.radius**2 - 8e-3**2) ** 0.5, abs=0.05e-3)
    holes = PHANTOMS["branch-top"]
    assert out[-1]["entry"] == pytest.approx(holes.entries[2, :3, 3], abs=0.3e-3)
    assert out[-1]["exit"] == pytest.approx(holes.exits[2, :3, 3], abs=0.1e-3)
    assert max(row["trauma"][0] for row in out) < 0.3e-6


def test_a_saved_pad_goes_on_with_the_same_bits():
    one, other = pad(), pad()
    for engine in (one, other):
        engine.configure(Setup(MS, None, {"needle": IMPULSE}))
    angles = np.arange(ENTRY - 0.1, ENTRY + 1.0, 0.01)
    driven(one, angles)
    other.restore(one.save())
    later = np.arange(ENTRY + 1.0, ENTRY + 1.2, 0.01)
    assert (
        driven(one, later)[-1]["needle/force"].tobytes() == driven(other, later)[-1]["needle/force"].tobytes()
    )
    assert one.state_hash() == other.state_hash()
    with pytest.raises(StateError, match="a saved state of 3 bytes"):
        one.restore(b"abc")


def test_the_skin_stands_up_where_the_needle_wants_out_and_only_near_it():
    engine = pad(node_period="1 ms")
    first = engine.configure(Setup(MS, None, {"needle": IMPULSE}))["skin/nodes"]
    rest = first.nodes_m.reshape(-1, 3)
    assert len(first.triangles) % 3 == 0
    exit_angle = pi - ENTRY
    out = driven(engine, np.arange(ENTRY - 0.1, exit_angle + 0.04, 0.01))
    before = next(i for i, row in enumerate(out) if row["phase"][0] == 3) - 1
    moved = out[before]["skin/nodes"].nodes_m.reshape(-1, 3) - rest
    at = int(np.linalg.norm(moved, axis=1).argmax())
    assert np.linalg.norm(rest[at] - PHANTOMS["branch-top"].exits[0, :3, 3]) < 1.5e-3
    assert moved[at, 2] > 0.1e-3
    assert np.abs(moved[np.linalg.norm(rest[:, :2], axis=1) > 0.06]).max() < 2e-5


def test_the_skin_is_closed_but_for_its_bottom_and_faces_outwards():
    skin = Skin((0.06, 0.05, 0.01), np.zeros((1, 3)))
    corners = skin.rest[skin.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    volume = np.einsum("ij,ij->", normals, corners[:, 0]) / 6.0
    # an open bottom at z = -h counts nothing but the sides and the top
    assert volume == pytest.approx(0.06 * 0.05 * 0.01 * 2 / 3, rel=1e-6)
    assert normals[:, 2].min() >= -1e-12


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"fixtures": {}}, "the scene has 0 phantoms; one is needed"),
        ({"objects": {}}, "the scene has 0 needles; one is needed"),
    ],
)
def test_a_scene_without_phantom_or_needle_is_refused(changes, problem):
    with pytest.raises(ValidationError, match=problem):
        pad(**changes)


def test_periods_that_do_not_fit_are_refused():
    with pytest.raises(ScenarioError, match="timestep 300000 ns does not divide"):
        pad(timestep="300 us").configure(Setup(MS, None))
    with pytest.raises(ScenarioError, match="node_period 1500000 ns is no multiple"):
        pad(node_period="1.5 ms").configure(Setup(MS, None))


class Free:
    """A needle of MuJoCo that no jaw holds, in the pad."""

    def __init__(self, **needle):
        turn = pi - ENTRY + 0.6 - NEEDLE.arc / 2
        axes = np.array([[np.cos(turn), -np.sin(turn), 0], [0, 0, 1], [-np.sin(turn), -np.cos(turn), 0]])
        x, y, z, w = rotation.from_matrix(axes).tolist()
        height = (NEEDLE.radius**2 - 8e-3**2) ** 0.5
        thing = {"kind": "needle", "position": [0.0, 0.018, height], "orientation": [x, y, z, w], **needle}
        arms = {"PSM1": {"position": [0.3, 0.0, 0.3]}}
        params = MujocoParams.model_validate(
            SCENE | {"arms": arms, "objects": {"needle": thing}, "looks": False}
        )
        self.robot, self.pad = MujocoEngine("robot", params), pad()
        self.robot_out = dict(self.robot.configure(Setup(MS, None, {"needle/wire": IMPULSE})))
        self.pad.configure(Setup(MS, None, {"needle": IMPULSE}))
        # the pad has been stitched up to here
        driven(self.pad, np.arange(ENTRY - 0.1, pi - ENTRY + 0.6, 0.004))
        self.values = {}
        for port in self.robot.ports:
            if port.causality == "input" and port.start is not None:
                self.values[port.name] = np.array(port.start)

    def run(self, steps):
        for i in range(steps):
            given = {
                f"needle/{what}": self.robot_out[f"needle/wire/{what}"] for what in ("position", "velocity")
            }
            force = self.pad.step(i * MS, MS, Inputs(given))["needle/force"]
            self.values["needle/wire/force"] = np.copy(force)
            self.robot_out.update(self.robot.step(i * MS, MS, Inputs(self.values)))
        return self.robot_out


def test_a_needle_that_is_let_go_in_the_tissue_stays_there():
    free = Free()
    before = np.copy(free.robot_out["needle/wire/position"])
    out = free.run(300)
    moved = np.linalg.norm((out["needle/wire/position"] - before).reshape(3, 3), axis=1)
    assert moved.max() < 0.8e-3
    assert np.abs(out["needle/wire/velocity"]).max() < 2e-3


def test_without_the_tissue_s_viscosity_it_is_thrown_out():
    with pytest.raises(SessionError, match="stiff for its step"):
        Free(drag=0.0).run(100)
