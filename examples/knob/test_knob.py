from trocar_example_knob import Knob, KnobParams

from trocar import check_device


def test_it_keeps_the_contract():
    check_device(lambda: Knob("knob", KnobParams()))
