"""Tests of participants of your own: `Driver` steps one without a session.

    from trocar.testing import Driver

    driver = Driver(Pendulum("pendulum", PendulumParams(start=0.3)))
    driver.set("torque", [0.1])
    assert driver.step(100)["angle"][0] < 0.3

`trocar.check_engine` and `trocar.check_device` check the contract; `trocar.run_in_process` runs a session.
"""

from hub.testing import Driver

__all__ = ["Driver"]
