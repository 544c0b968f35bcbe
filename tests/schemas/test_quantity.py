from __future__ import annotations

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ValidationError

from schemas import quantity
from schemas.quantity import Duration, Force, Length, same_unit, to_si

nonsense = st.one_of(
    st.text(max_size=12),
    st.lists(
        st.sampled_from(
            [
                "m",
                "mm",
                "kg",
                "N",
                "bogus",
                "degC",
                "%",
                "²",
                "1",
                "9",
                "*",
                "**",
                "^",
                "/",
                "(",
                ")",
                "-",
                " ",
                "nan",
            ]
        ),
        max_size=8,
    ).map("".join),
)


class Model(BaseModel):
    length: Length = 0.0
    duration: Duration = 0


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("80 mm", "m", 0.08),
        ("80mm", "m", 0.08),
        (" -1.5e-3 km ", "m", -1.5),
        (".5 m", "m", 0.5),
        ("10 kPa", "Pa", 1e4),
        ("1000 kg/m^3", "kg/m^3", 1000),
        ("1 g/cm**3", "kg/m^3", 1000),
        ("5 N*s/m", "N*s/m", 5),
        ("5 N/(m/s)", "N*s/m", 5),
        ("5 N s / m", "N*s/m", 5),
        ("180 deg", "rad", math.pi),
        ("37 degC", "K", 310.15),
        ("3 µm", "m", 3e-6),
        ("7", "m", 7),
        (7, "m", 7),
        (0.5, "m", 0.5),
    ],
)
def test_quantities_become_si(text: float | str, unit: str, value: float) -> None:
    assert to_si(text, unit) == pytest.approx(value, rel=1e-12)


NO_LENGTHS = [
    "80 N",
    "mm",
    "",
    "80 80",
    "80 mm mm",
    "1 m/m",
    "nan m",
    "inf",
    "1e999",
    "0x10 m",
    "1_0 m",
    "2*3 m",
    "9**9**9",
    "1 m**9**9**9",
    "1 m\n1 m",
    "1 (m",
]


@pytest.mark.parametrize("value", [*NO_LENGTHS, True, None, [1], math.nan, math.inf, 10**400])
def test_what_is_no_length_is_a_value_error(value: object) -> None:
    with pytest.raises(ValueError, match=r"quantity in m"):
        to_si(value, "m")


@pytest.mark.parametrize(
    "value",
    [
        "1 " + "(" * 10_000 + "m" + ")" * 10_000,
        "1 " + "(" * 45 + "m" + ")" * 45 + "x",
        "1 " + "a" * 100_000,
        "1 " + "m*" * 10_000 + "m",
        "1" * 100_000 + " m",
        int("f" * 100_000, 16),
    ],
    ids=range(6),
)
def test_what_is_too_long_is_a_short_value_error(value: object) -> None:
    with pytest.raises(ValueError, match=r"not a quantity in m") as caught:
        to_si(value, "m")
    assert len(str(caught.value)) < 300


def test_a_unit_of_a_port_is_not_too_long() -> None:
    assert not same_unit("(" * 10_000 + "m" + ")" * 10_000, "m")
    assert not same_unit("a" * 100_000, "m")


@given(nonsense, nonsense)
def test_nonsense_raises_nothing_but_value_error(text: str, unit: str) -> None:
    for value in (text, "1 " + text):
        with contextlib.suppress(ValueError):
            assert math.isfinite(to_si(value, "m"))
    assert same_unit(text, unit) == same_unit(unit, text)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_plain_numbers_stay(number: float) -> None:
    assert to_si(number, "m") == to_si(repr(number), "m") == number


@given(st.floats(-1e6, 1e6))
def test_units_scale(number: float) -> None:
    assert to_si(f"{number!r} mm", "m") == pytest.approx(number / 1000, rel=1e-12, abs=1e-300)


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("m", "m", True),
        ("", "m", True),
        ("N*s/m", "kg/s", True),
        ("N*m", "J", True),
        ("Hz", "1/s", True),
        ("mm", "m", False),
        ("m", "N", False),
        ("degC", "K", False),
        ("no unit", "m", False),
        ("N.m", "N.m", True),
    ],
)
def test_same_unit(one: str, other: str, same: bool) -> None:
    assert same_unit(one, other) is same


@given(st.integers(0, 10**15))
def test_durations_are_whole_nanoseconds(ns: int) -> None:
    assert Model(duration=f"{ns} ns").duration == ns  # type: ignore[arg-type]
    model = Model(duration=f"{ns} ns")  # type: ignore[arg-type]
    assert Model.model_validate_json(model.model_dump_json()) == model


@pytest.mark.parametrize(
    ("text", "ns"), [("1 ms", 10**6), (0.001, 10**6), ("2.5 us", 2500), ("1 min", 60 * 10**9), (1, 10**9)]
)
def test_durations(text: float | str, ns: int) -> None:
    assert Model(duration=text).duration == ns  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "value", ["0.1 ns", "1 m", math.inf, math.nan, "1e300 s", 1e305, "300 years", "a while", None, True]
)
def test_no_duration(value: object) -> None:
    with pytest.raises(ValidationError):
        Model.model_validate({"duration": value})


def test_the_schema_tells_the_unit_and_an_example() -> None:
    schema = Model.model_json_schema()["properties"]["length"]
    assert "m" in schema["description"]
    assert schema["examples"] == ["80 mm"]


def test_a_wrong_dimension_says_what_was_wanted() -> None:
    class Pull(BaseModel):
        force: Force

    with pytest.raises(ValidationError, match="'2 kg' is not a quantity in N"):
        Pull.model_validate({"force": "2 kg"})


@given(
    number=st.floats(-1e9, 1e9),
    units=st.sampled_from([*quantity._FACTORS, *((u, u) for _, u in quantity._FACTORS)]),
)
def test_units_that_are_known_without_pint_are_as_in_pint(number: float, units: tuple[str, str]) -> None:
    unit, target = units
    assert (
        to_si(f"{number!r} {unit}", target)
        == quantity._registry().Quantity(number, unit).to(target).magnitude
    )
