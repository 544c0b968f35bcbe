"""The controller of README.md."""

import re
from pathlib import Path

import pytest

from trocar import Params, check_engine
from trocar.testing import Driver

README = Path(__file__).parents[2] / "README.md"


def test_the_controller_of_the_readme_presses_and_goes_back():
    (text,) = re.findall(r"```python\n(.*?class Press.*?)```", README.read_text(), re.DOTALL)
    names = {}
    exec(text, names)
    still = {"measured_js": [0, 0, 0.12, 0, 0, 0] + [0] * 12}
    check_engine(lambda: names["Press"]("press", Params()), period_ns=1_000_000, inputs=still)
    driver = Driver(names["Press"]("press", Params()), inputs=still)
    depths = [driver.step(500)["servo_jp"][2] for _ in range(4)]
    assert depths == pytest.approx([0.1275, 0.135, 0.1275, 0.12], abs=1e-6)
