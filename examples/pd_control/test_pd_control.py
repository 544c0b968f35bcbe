from trocar_example_pd_control import PdControl, PdControlParams

from trocar import check_engine


def test_it_keeps_the_contract():
    inputs = {"goal": [0.3], "angle": [0.1], "rate": [-0.2]}
    check_engine(lambda: PdControl("pd", PdControlParams()), period_ns=1_000_000, inputs=inputs)
