import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.caliper import Caliper, CaliperParams, width_of_mesh
from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from controllers.routine import Routine, RoutineParams
from engines.bullet.engine import BulletEngine
from engines.bullet.params import BulletParams
from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.participant import Inputs, Setup
from hub.testing import check_engine, run_in_process
from robots.dvrk.end_effectors.musha import HAND
from schemas.errors import SessionError, StateError
from schemas.ros import Header
from schemas.trocar_msgs import SoftBodyState

H = 1_000_000
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32) * [
    0.03,
    0.02,
    0.01,
]
BOX = np.array(
    [
        [0, 1, 3],
        [0, 3, 2],
        [4, 6, 7],
        [4, 7, 5],
        [0, 4, 5],
        [0, 5, 1],
        [2, 3, 7],
        [2, 7, 6],
        [0, 2, 6],
        [0, 6, 4],
        [1, 5, 7],
        [1, 7, 3],
    ],
    np.uint32,
)
NODES = SoftBodyState(
    header=Header(frame_id="world"),
    body="box",
    nodes_m=CORNERS.astype(np.float32).ravel(),
    triangles=BOX.ravel(),
)


class Run:
    """A caliper around a rigid box: a finger feels it when the tip's surface is inside."""

    def __init__(self, tmp_path, half_width=0.02, **params):
        self.caliper = Caliper(
            "caliper", CaliperParams.model_validate({"arm": "PSM1", "rate": 0.5, **params})
        )
        self.outputs, self.t, self.half_width = self.caliper.configure(Setup(H, tmp_path)), 0, half_width
        self.command = HAND.command("caliper", 0.1)

    def step(self, start=1.0):
        q = HAND.unloaded_positions(self.command)
        contacts = HAND.contacts(q)
        force = np.zeros((3, 3, 3))
        for finger in range(2):
            force[finger, 2, 1] = 100.0 * max(
                0.0, self.half_width + HAND.radius - np.hypot(*contacts[finger, 2, :2])
            )
        # fingers open along y, fingertips at z = 0
        world = contacts[..., [1, 0, 2]] - [0.0, 0.0, contacts[0, 2, 2]]
        values = {
            "start": np.array([start]),
            "hand": np.concatenate([self.command, np.zeros(12)]),
            "phalanges": np.concatenate([q.ravel(), np.zeros(18)]),
        }
        inputs = Inputs({**values, "position": world.ravel(), "force": force.ravel(), "nodes": NODES})
        self.outputs = dict(self.caliper.step(self.t, H, inputs))
        self.t += H
        for message in self.outputs["PSM1/hand/servo_jp"]:
            self.command = message.position
        return self

    def until_measured(self):
        while not self.outputs["width"][0]:
            self.step()
        return self


def test_the_width_is_that_of_the_box(tmp_path):
    run = Run(tmp_path).until_measured()
    assert run.outputs["width"][0] == pytest.approx(0.04, abs=0.002)
    assert run.outputs["true_width"][0] == pytest.approx(0.04, abs=1e-6)


def test_nothing_happens_before_the_start(tmp_path):
    run = Run(tmp_path)
    for _ in range(5):
        run.step(start=0.0)
        assert run.outputs["PSM1/hand/servo_jp"] == ()


def test_after_the_measurement_the_fingers_stay(tmp_path):
    run = Run(tmp_path).until_measured()
    width = run.outputs["width"].copy()
    assert run.step().outputs["PSM1/hand/servo_jp"] == ()
    assert run.outputs["width"] == width


def test_the_third_finger_stays_away(tmp_path):
    run = Run(tmp_path).step()
    assert (
        run.command.reshape(2, 3)[:, 2].tolist() == HAND.command("caliper", 0.0).reshape(2, 3)[:, 2].tolist()
    )


def test_closing_on_nothing_ends_the_session(tmp_path):
    run = Run(tmp_path, half_width=-1.0)
    with pytest.raises(SessionError, match="finger1 and finger2 closed without feeling"):
        run.until_measured()


def test_a_restored_caliper_goes_on_where_it_was(tmp_path):
    run, other = Run(tmp_path), Run(tmp_path)
    for _ in range(10):
        run.step()
    other.caliper.restore(run.caliper.save())
    other.command = run.command
    assert run.until_measured().caliper.state_hash() == other.until_measured().caliper.state_hash()
    with pytest.raises(StateError, match="3 bytes"):
        run.caliper.restore(b"abc")


def test_it_keeps_the_contract_of_a_controller():
    check_engine(lambda: Caliper("caliper", CaliperParams(arm="PSM1")), period_ns=H, inputs={"nodes": NODES})


@given(st.floats(-0.0099, 0.0099), st.floats(-0.0299, 0.0299))
def test_the_width_of_a_box_is_its_edge_wherever_it_is_measured(z, x):
    triangles = CORNERS[BOX]
    assert width_of_mesh(triangles, np.array([x, -1.0, z]), np.array([x, 1.0, z])) == pytest.approx(
        0.04, rel=1e-6
    )


def test_a_line_that_misses_has_no_width():
    assert width_of_mesh(CORNERS[BOX], np.array([0.5, -1.0, 0.0]), np.array([0.5, 1.0, 0.0])) == 0.0


@pytest.mark.long
def test_a_block_is_measured_through_both_engines():
    """The scenario `caliper` in small: 40 mm of soft tissue, in one process."""
    scenario = {
        "name": "caliper",
        "step": "0.5 ms",
        "duration": "0.7 s",
        "order": ["tissue", "caliper", "motion", "robot"],
        "connections": [
            *(
                "caliper.* -> motion.*",
                "motion.drive/* -> robot.*",
                "robot.* -> motion.sense/*",
                "tissue.hand/force -> caliper.force",
            ),
            *(
                "robot.PSM1/hand/measured_js -> caliper.hand",
                "robot.PSM1/hand/phalanges/measured_js -> caliper.phalanges",
            ),
            *(
                "robot.PSM1/contact/position -> caliper.position",
                "tissue.block/nodes -> caliper.nodes",
                "clock.done -> caliper.start",
            ),
        ],
        "bonds": [{"motion": "robot.PSM1/contact", "force": "tissue.hand", "algorithm": "impulse"}],
        "measure": {
            "width": {"kind": "final", "of": "caliper.width"},
            "true_width": {"kind": "final", "of": "caliper.true_width"},
        },
    }
    arm = {
        "instrument": "MUSHA_HAND",
        "position": [0, 0, "153 mm"],
        "start": [0, 0, 0.13, 0],
        "hand": HAND.command("caliper", 0.38).tolist(),
    }
    block = {"size": ["30 mm", "40 mm", "20 mm"], "young_modulus": "10 kPa", "nodes": 60}
    participants = {
        "clock": Routine("clock", RoutineParams.model_validate({"steps": [{"do": "wait", "time": 0}]})),
        "caliper": Caliper("caliper", CaliperParams(arm="PSM1", rate=0.25)),
        "motion": MotionController(
            "motion",
            MotionParams.model_validate(
                {"mounting": "free", "initial_state": "homed", "arms": {"PSM1": arm}}
            ),
        ),
        "robot": MujocoEngine("robot", MujocoParams.model_validate({"arms": {"PSM1": arm}, "looks": False})),
        "tissue": BulletEngine(
            "tissue",
            BulletParams.model_validate(
                {
                    "timestep": "0.5 ms",
                    "organs": {"block": block},
                    "probes": {"hand": {"spheres": 9, "radius": "2.4 mm", "stiffness": "500 N/m"}},
                }
            ),
        ),
    }
    measured = run_in_process(scenario, participants).measures
    assert measured["true_width"] == pytest.approx(0.04, rel=0.01)
    assert measured["width"] == pytest.approx(measured["true_width"], rel=0.05)
