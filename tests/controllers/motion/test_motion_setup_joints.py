import numpy as np
import pytest

from controllers.motion.controller import MotionController
from controllers.motion.params import MotionParams
from hub.testing import check_engine
from robots import rotation
from robots.dvrk.setup_joints import SIMULATED, base_pose
from schemas.crtk import StringStamped
from tests.controllers.motion.rig import CART, PSM1, H, Rig, jp

SUJ = [f"SUJ/{arm}" for arm in CART]


def command(text):
    return StringStamped(string=text)


def states(rig, prefix="SUJ/PSM1"):
    return [(m.state, m.is_homed, m.is_busy) for m in rig.heard.get(f"{prefix}/operating_state", ())]


@pytest.mark.parametrize("arm", CART)
def test_they_tell_where_they_are_and_where_that_puts_the_arm(arm):
    set_to = [0.1, 0.2, 0.3, 0.4, *((0.0, 0.0) if arm == "ECM" else (0.5, 0.6))]
    for positions, params in (SIMULATED[arm], {}), (set_to, {"setup_joints": {arm: set_to}}):
        rig = Rig(CART, **params).step(10)
        assert rig.outputs[f"SUJ/{arm}/measured_js"].tolist() == list(positions)
        base, told = base_pose(arm, np.array(positions)), rig.outputs[f"SUJ/{arm}/local/measured_cp"]
        assert np.allclose(told[:3], base[:3, 3], atol=1e-12)
        assert np.allclose(rotation.matrix(told[3:]), base[:3, :3], atol=1e-12)
    ports = {port.name: port for port in rig.motion.ports}
    assert ports[f"SUJ/{arm}/measured_js"].names == tuple(f"SUJ_{arm}_J{i}" for i in range(6))
    assert ports[f"SUJ/{arm}/local/measured_cp"].frame == "Cart"
    assert ports[f"SUJ/{arm}/measured_cp"].frame == ("Cart" if arm == "ECM" else "ECM")


def test_without_a_cart_there_are_none():
    names = {port.name for port in Rig(PSM1, mounting="free").motion.ports if port.name.startswith("SUJ/")}
    assert names == {"SUJ/PSM1/measured_cp"}


def test_the_contract_of_participants_is_kept():
    params = MotionParams.model_validate({"mounting": "cart", "arms": CART})
    orders = {"SUJ/PSM1/state_command": (command("enable"),), "SUJ/ECM/move_jp": (jp(*[0.0] * 6),)}
    check_engine(lambda: MotionController("motion", params), period_ns=H, inputs=orders)


def test_their_state_is_shared_and_told_at_time_0():
    rig = Rig(CART, initial_state="disabled").step()
    assert all(states(rig, prefix) == [("DISABLED", True, False)] for prefix in SUJ)
    rig.step(1, SUJ__PSM2__state_command=command("enable"))
    assert all(states(rig, prefix) == [("DISABLED", True, True)] for prefix in SUJ)
    rig.step(100)
    assert all(states(rig, prefix) == [("ENABLED", True, False)] for prefix in SUJ)
    assert states(Rig(CART).step()) == [("ENABLED", True, False)]


@pytest.mark.parametrize(
    ("way", "after"),
    [
        (["disable"], ("DISABLED", True, False)),
        (["unhome"], ("ENABLED", False, False)),
        (["unhome", "home"], ("ENABLED", True, False)),
        (["enable"], ("ENABLED", True, False)),
        (["disable", "home"], ("ENABLED", True, False)),
    ],
)
def test_each_command_does_what_it_says(way, after):
    rig = Rig(CART).step()
    for text in way:
        rig.step(110, SUJ__PSM1__state_command=command(text))
        assert not rig.heard.get("SUJ/PSM1/warning")
    assert states(rig)[-1] == after


@pytest.mark.parametrize("text", ["pause", "resume", "fly"])
def test_what_they_do_not_do_is_refused(text):
    rig = Rig(CART).step().step(1, SUJ__PSM1__state_command=command(text))
    assert len(rig.heard["SUJ/PSM1/warning"]) == 1
    assert not states(rig)


@pytest.mark.parametrize("name", ["move_jp", "servo_jp"])
def test_they_are_braked(name):
    rig = Rig(CART).step(10)
    before = rig.outputs["SUJ/PSM1/measured_js"].copy()
    rig.step(100, **{f"SUJ__PSM1__{name}": jp(*[0.1] * 6)})
    assert [m.data for m in rig.heard["SUJ/PSM1/warning"]] == [
        f"SUJ/PSM1: {name} refused: the setup joints are braked; `setup_joints` of the scenario sets"
        " their positions"
    ]
    assert (rig.outputs["SUJ/PSM1/measured_js"] == before).all()
    assert not rig.heard.get("SUJ/PSM2/warning")


def test_a_checkpoint_in_the_middle_of_powering_goes_on_alike():
    rig = Rig(CART, initial_state="disabled").step().step(50, SUJ__PSM1__state_command=command("enable"))
    saved, heard = rig.motion.save(), []
    for _ in range(2):
        rig.motion.restore(saved)
        heard.append([(rig.step().motion.state_hash(), states(rig)) for _ in range(60)])
    assert heard[0] == heard[1]
    assert any(told for _, told in heard[0])
