import pytest
from trocar_example_wave import Wave, WaveParams

from trocar import check_device


@pytest.mark.parametrize("clock", ["simulated", "wall"])
def test_it_keeps_the_contract(clock):
    check_device(lambda: Wave("wave", WaveParams(clock=clock)))
