from trocar_example_pendulum import Pendulum, PendulumParams

from trocar import check_engine


def test_it_keeps_the_contract():
    params = PendulumParams.model_validate({"start": "20 deg"})
    check_engine(lambda: Pendulum("pendulum", params), period_ns=1_000_000, inputs={"torque": [0.1]})
