from two_mass import Mass, MassParams, SprungMass

from trocar import check_engine

MASS = {"mass": 1.0, "stiffness": 10.0, "damping": 0.1}
SPRUNG = MASS | {"coupling_stiffness": 100.0, "coupling_damping": 1.0}
STEP_NS = 1_000_000


def test_the_motion_side_keeps_the_contract():
    params = MassParams(**MASS, x=1.0)
    check_engine(lambda: Mass("one", params), period_ns=STEP_NS, inputs={"tip/force": [-2.0]})


def test_the_force_side_keeps_the_contract():
    inputs = {"tip/position": [0.5], "tip/velocity": [0.2]}
    check_engine(lambda: SprungMass("two", MassParams(**SPRUNG)), period_ns=STEP_NS, inputs=inputs)
