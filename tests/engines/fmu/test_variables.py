from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engines.fmu.variables import number_type, port_name
from schemas.keys import valid_name

fmu_names = st.one_of(
    st.text(alphabet="ab_xX.5BF[]/19", min_size=1, max_size=16),
    st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1, max_size=12),
)


def variable_name(port: str) -> str:
    """The documented way back from a port name to the FMU's variable."""

    def character(match: re.Match[str]) -> str:
        return chr(int(match[1], 16))

    def part(text: str) -> str:
        head = re.match(r"x([0-9A-F]{2,})_", text)
        first, rest = (character(head), text[head.end() :]) if head else (text[0], text[1:])
        return first + re.sub(r"_x([0-9A-F]{2,})_", character, rest)

    return ".".join(map(part, port.split("/")))


@given(fmu_names)
def test_port_names_are_valid_and_lead_back_to_the_variable(name: str) -> None:
    port = port_name(name)
    assert all(valid_name(part) for part in port.split("/"))
    assert variable_name(port) == name


@pytest.mark.parametrize(
    ("variable", "port"),
    [
        ("x", "x"),
        ("arm.joint_1.q", "arm/joint_1/q"),
        ("body.r[1]", "body/r_x5B_1_x5D_"),
        ("der(v)", "der_x28_v_x29_"),
        ("_q", "x5F_q"),
        ("x1_y", "x1_y"),
    ],
)
def test_port_names_of_common_variables(variable: str, port: str) -> None:
    assert port_name(variable) == port


@pytest.mark.parametrize(
    ("major", "name", "good", "bad"),
    [
        (2, "Integer", [-(2**31), 0, 2**31 - 1], [0.5, 2**31, -(2**31) - 1]),
        (2, "Boolean", [0, 1], [2, 0.5, -1]),
        (3, "Boolean", [0, 1], [2, 0.5, -1]),
        (3, "UInt8", [0, 255], [-1, 256]),
        (3, "Int64", [-(2**53), 2**53], [2**54, 1.5]),
        (3, "Enumeration", [1, 2], [1.5]),
        (3, "Float32", [1e38, -1e38], [1e39]),
        (3, "Float64", [1e308], []),
    ],
)
def test_numbers_have_an_exact_place_or_are_refused(
    major: int, name: str, good: list[float], bad: list[float]
) -> None:
    number = number_type(major, name)
    assert number is not None
    kept = number.from_float64(np.array(good, np.float64), "v")
    assert kept.dtype == number.dtype
    assert np.allclose(kept.astype(np.float64), good, rtol=1e-7)
    for value in [*bad, np.nan, np.inf]:
        with pytest.raises(ValueError, match="'v' takes"):
            number.from_float64(np.array([value], np.float64), "v")


@pytest.mark.parametrize("name", ["String", "Binary", "Clock"])
def test_other_types_hold_no_numbers(name: str) -> None:
    assert number_type(3, name) is None
