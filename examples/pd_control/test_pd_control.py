from trocar_example_pd_control import PdControl, PdControlParams

from trocar import check_engine
from trocar.testing import Driver


def test_it_keeps_the_contract():
    inputs = {"goal": [0.3], "angle": [0.1], "rate": [-0.2]}
    check_engine(lambda: PdControl("pd", PdControlParams()), period_ns=1_000_000, inputs=inputs)


def test_it_holds_the_goal_while_its_device_is_silent():
    driver = Driver(PdControl("pd", PdControlParams()), inputs={"goal": [0.2]})
    assert driver.step()["torque"][0] == 0.4
    driver.stale("goal")
    driver.set("goal", [0.3])
    assert driver.step()["torque"][0] == 0.4
