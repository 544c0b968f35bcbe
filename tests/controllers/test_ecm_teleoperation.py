import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from controllers.ecm_teleoperation import EcmTeleoperation, EcmTeleoperationParams
from hub.testing import Driver, check_engine
from robots import rotation
from robots.dvrk import ecm, endoscope
from schemas.crtk import OperatingState
from schemas.errors import StateError
from schemas.ros import Joy, StringMessage

H = 1_000_000
DT = H * 1e-9
CHAIN = ecm.chain()


class Session:
    """A controller with a head, buttons and a clock."""

    def __init__(self, q=ecm.HOME, **params):
        self.controller = EcmTeleoperation("camera", EcmTeleoperationParams.model_validate(params))
        self.driver = Driver(self.controller, period_ns=H)
        self.driver.set("measured_js", [*q, *np.zeros(8)])
        self.head, self.twist, self.measured, self.scale = (
            self.driver.values[port] for port in ("pose", "twist", "measured_js", "scale")
        )
        self.modes, self.warnings = [], []

    outputs = property(lambda self: self.driver.outputs)

    def step(self, *modes, buttons=(), state=(), stale=(), count=1):
        self.driver.stale(*stale)
        self.driver.send("mode", *(StringMessage(data=mode) for mode in modes))
        self.driver.send("buttons", *(Joy(buttons=b) for b in buttons))
        self.driver.send("operating_state", *(OperatingState(state=s, is_homed=homed) for s, homed in state))
        self.driver.step(count)
        self.modes += [m.data for m in self.driver.sent.get("active_mode", ())]
        self.warnings += [m.data for m in self.driver.sent.get("warning", ())]
        return self

    @property
    def q(self):
        return self.outputs["servo_jp"].copy()

    @property
    def velocity(self):
        return self.outputs["joint_velocity"].copy()


def camera(scope, q):
    """Orientation of the picture (x right, y down, z ahead) in ECM_base, from the link's pose and the
    cameras' mounting.
    """
    roll = CHAIN.forward(np.array(q)) @ np.linalg.inv(ecm.tip("straight"))
    return (roll @ endoscope.optical_in_roll(scope))[:3, :3]


def numeric_jacobian(scope, q, h=1e-3):
    """Angular velocity of the camera, in its own picture's frame, by joints 1, 2 and 4: fourth-order
    differences, shape (3, 3).
    """
    here, columns = camera(scope, q), []
    for joint in (0, 1, 3):

        def turned(way, joint=joint):
            there = np.array(q)
            there[joint] += way
            return Rotation.from_matrix(here.T @ camera(scope, there)).as_rotvec()

        columns.append((turned(-2 * h) - 8 * turned(-h) + 8 * turned(h) - turned(2 * h)) / (12 * h))
    return np.array(columns).T


OPTICAL_IN_HEAD = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""What is right (-y), down (-z) and ahead (x) for a head."""

configurations = st.tuples(
    *[
        st.floats(low + 0.01 * (high - low), high - 0.01 * (high - low))
        for low, high in zip(CHAIN.lower, CHAIN.upper, strict=True)
    ]
)
vectors = st.tuples(*[st.floats(-0.1, 0.1)] * 3).map(np.array)
turns = st.tuples(*[st.floats(-1.5, 1.5)] * 3).map(np.array)
scopes = st.sampled_from(["straight", "up", "down"])


@given(scopes, configurations, turns, vectors, vectors)
def test_the_equations_of_the_paper(scope, q, turn, v, w):
    """w_C = w_R with the insertion at rest; dq_3 = v_R,z with the others at rest; each to 1e-9, whatever the
    head looks at.
    """
    session = Session(q, endoscope=scope)
    session.head[3:] = rotation.exp(turn)
    to_base = Rotation.from_rotvec(turn).as_matrix()
    session.twist[:] = np.concatenate([to_base @ v, to_base @ w])
    velocity = session.step().velocity
    jacobian = numeric_jacobian(scope, q)
    expected = np.linalg.pinv(jacobian) @ (OPTICAL_IN_HEAD @ w)
    allowed = CHAIN.velocity[[0, 1, 3]]
    expected /= max(1.0, np.abs(expected / allowed).max())
    assert np.allclose(velocity[[0, 1, 3]], expected, rtol=0.0, atol=1e-9)
    assert velocity[2] == 0.0
    assert np.allclose(session.q, np.array(q) + DT * velocity, rtol=0.0, atol=1e-12)
    velocity = session.step("position").velocity
    assert velocity[2] == pytest.approx(np.clip(v[0], -CHAIN.velocity[2], CHAIN.velocity[2]), abs=1e-9)
    assert (velocity[[0, 1, 3]] == 0.0).all()


def test_a_straight_endoscope_sees_what_the_head_would():
    """Left is left and up is up in the picture, and coming nearer goes in."""
    session = Session()
    before = camera("straight", session.q)
    session.twist[3:] = [0.0, -0.1, 0.2]  # up, and to the left
    session.step(count=100)
    looks_at = before.T @ camera("straight", session.q) @ [0, 0, 1]
    assert looks_at[0] == pytest.approx(-0.02, abs=1e-3)  # left
    assert looks_at[1] == pytest.approx(-0.01, abs=1e-3)  # up
    session.twist[:] = [0.05, 0, 0, 0, 0, 0]
    tip = CHAIN.forward(session.q)[:3, 3]
    session.step("position", count=100)
    assert camera("straight", session.q)[:, 2] @ (CHAIN.forward(session.q)[:3, 3] - tip) == pytest.approx(
        0.005, rel=1e-9
    )


def test_the_camera_turns_with_the_head_by_the_same_angle():
    session, rng = Session(endoscope="up"), np.random.default_rng(3)
    before, head = camera("up", session.q), np.eye(3)
    for _ in range(400):
        w = rng.uniform(-0.3, 0.3, 3)
        session.head[3:], session.twist[3:] = Rotation.from_matrix(head).as_quat(), head @ w
        session.step()
        head = head @ Rotation.from_rotvec(w * DT).as_matrix()
    turned = OPTICAL_IN_HEAD @ head @ OPTICAL_IN_HEAD.T
    assert np.allclose(before.T @ camera("up", session.q), turned, atol=1e-4)  # what a step of 1 ms leaves


def test_scale_is_of_both_motions():
    session = Session(scale=0.5)
    session.twist[:] = [0.02, 0, 0, 0.2, 0, 0]
    assert session.step().velocity[3] == pytest.approx(0.1)
    session.scale[0] = 2.0
    assert session.step("position").velocity[2] == pytest.approx(0.04)


def test_a_scale_that_would_turn_the_camera_the_other_way_is_refused_once():
    session = Session(scale=0.5)
    session.twist[3] = 0.2
    session.scale[0] = -2.0
    assert session.step(count=3).velocity[3] == pytest.approx(0.1)
    assert session.warnings == ["scale -2 is refused, it must be above 0; it stays 0.5"]


@given(
    st.lists(
        st.tuples(st.sampled_from(["orientation", "position", "stale"]), *[st.floats(-4, 4)] * 6),
        min_size=1,
        max_size=12,
    )
)
def test_no_joint_is_ever_too_fast_or_out_of_its_range(moves):
    session = Session()
    for mode, *twist in moves:
        session.twist[:] = twist
        for _ in range(40):
            before = session.q
            session.step(*([] if mode == "stale" else [mode]), stale=["pose"] if mode == "stale" else [])
            assert (np.abs(session.velocity) <= CHAIN.velocity * (1 + 1e-12)).all()
            assert (session.q >= CHAIN.lower).all()
            assert (session.q <= CHAIN.upper).all()
            assert np.allclose(session.q - before, DT * session.velocity, rtol=0.0, atol=1e-15)


def test_all_joints_slow_down_together():
    slow, fast = Session([0.3, 0.2, 0.1, 0.1]), Session([0.3, 0.2, 0.1, 0.1])
    slow.twist[3:], fast.twist[3:] = [0.02, -0.03, 0.05], [2, -3, 5]
    a, b = slow.step().velocity, fast.step().velocity
    assert np.abs(b / CHAIN.velocity).max() == pytest.approx(1.0)
    assert np.allclose(a / np.linalg.norm(a), b / np.linalg.norm(b), atol=1e-12)


def test_at_the_end_of_a_range_nothing_is_stored_and_the_others_go_on():
    session = Session([0.0, CHAIN.upper[1] - 1e-4, 0.1, 0.0])
    way = OPTICAL_IN_HEAD.T @ numeric_jacobian("straight", session.measured[:4])[:, 1]
    session.twist[3:] = 0.3 * way + OPTICAL_IN_HEAD.T @ np.array([0.0, 0.0, 0.1])
    session.step(count=3)
    assert session.q[1] == CHAIN.upper[1]
    assert session.velocity[1] == 0.0
    assert abs(session.velocity[3]) == pytest.approx(0.1, rel=0.01)
    session.twist[3:] = -0.3 * way
    assert session.step().velocity[1] == pytest.approx(-0.3, rel=1e-3)  # back at once
    session = Session([0, 0, CHAIN.upper[2] - 1e-5, 0], mode="position")
    session.twist[0] = 0.05
    session.step(count=100)
    assert session.q[2] == CHAIN.upper[2]
    session.twist[0] = -0.05
    assert session.step().velocity[2] == -0.05


@pytest.mark.parametrize("silent", [["pose"], ["twist"], ["pose", "twist"]])
def test_a_head_that_is_not_heard_leaves_the_camera_where_it_is(silent):
    session = Session()
    session.twist[3:] = [0.1, 0.1, 0.1]
    held = session.step(count=10).q
    session.step(stale=silent, count=20)
    assert (session.q == held).all()
    assert (session.velocity == 0.0).all()
    assert (session.step().velocity != 0.0).any()


def test_the_dead_man_is_to_be_held():
    session = Session(buttons={"dead_man": 1})
    session.twist[5] = 0.1
    held = session.step(count=5).q
    assert (session.step(buttons=[[0]]).q == held).all()  # a Joy without it says nothing
    session.step(buttons=[[0, 1]], count=5)
    assert session.velocity.any()
    held = session.q
    assert (session.step(buttons=[[0, 0]], count=5).q == held).all()


def test_the_mode_is_switched_by_word_and_by_button():
    session = Session()
    session.step("position").step("position").step(buttons=[[1]]).step(buttons=[[1]]).step(
        buttons=[[0], [1]]
    ).step(buttons=[[0]])
    assert session.modes == ["position", "orientation", "position"]
    session.step("positon")
    assert session.warnings == [
        "there is no mode 'positon'. Did you mean 'position'? Known: orientation, position."
    ]
    assert session.modes[3:] == []


def test_it_starts_from_where_the_arm_is_and_again_when_it_becomes_ready():
    session = Session([0.2, 0.1, 0.05, -0.3])
    assert (session.step().q == session.measured[:4]).all()
    session.twist[5] = 0.2
    session.step(count=10, state=[("DISABLED", True)])
    assert (session.q == session.measured[:4]).all()
    session.measured[:4] = [-0.2, 0.3, 0.1, 0.0]
    session.step(count=2, state=[("ENABLED", False)])
    assert session.q[0] == 0.2
    session.twist[:] = 0
    assert (session.step(state=[("ENABLED", True)]).q == session.measured[:4]).all()
    session.measured[:4] = [0.0, 0.0, 0.1, 0.0]
    assert session.step(state=[("ENABLED", True)]).q[0] == -0.2  # it was ready


@pytest.mark.parametrize("mode", ["orientation", "position"])
def test_the_contract_of_a_controller(mode):
    twist = [0.02, 0.01, 0.0, 0.1, 0.2, 0.3]
    inputs = {"pose": [0, 0, 0, 0, 0, 0, 1], "twist": twist, "buttons": (Joy(buttons=[0, 1]),)}
    params = EcmTeleoperationParams(mode=mode, endoscope="down")
    check_engine(lambda: EcmTeleoperation("camera", params), period_ns=H, inputs=inputs)


def test_restore_returns_to_the_same_bits():
    def go_on(session):
        rng = np.random.default_rng(1)
        for _ in range(50):
            session.twist[:] = rng.normal(0, 0.2, 6)
            session.step(*(["position"] if rng.random() < 0.1 else []), buttons=[[int(rng.random() < 0.3)]])
        return session.controller.state_hash()

    session = Session()
    go_on(session)
    saved = session.controller.save()
    expected = go_on(session)
    for again in (session, Session()):
        again.controller.restore(saved)
        assert go_on(again) == expected
    with pytest.raises(StateError, match="8 bytes"):
        session.controller.restore(bytes(8))


@pytest.mark.parametrize(
    "params",
    [
        {"scale": 0},
        {"start": [0, 2.0, 0.1, 0]},
        {"mode": "both"},
        {"buttons": {"mode": 1, "dead_man": 1}},
        {"buttons": {"jaw": 1}},
    ],
)
def test_parameters_out_of_range(params):
    with pytest.raises(ValidationError):
        EcmTeleoperationParams.model_validate(params)
