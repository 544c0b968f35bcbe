from __future__ import annotations

import pytest

from schemas import errors
from schemas.errors import MissingExtraError, ParticipantError, ScenarioError, TrocarError, did_you_mean


@pytest.mark.parametrize("name", errors.__all__)
def test_every_error_is_a_trocar_error_and_stands_in_the_tree(name: str) -> None:
    if name != "did_you_mean":
        assert issubclass(getattr(errors, name), TrocarError)
        assert name in (errors.__doc__ or "")


def test_did_you_mean() -> None:
    assert did_you_mean("mujco", ["mujoco", "bullet"]) == " Did you mean 'mujoco'? Known: bullet, mujoco."
    assert did_you_mean("xyz", ["mujoco"]) == " Known: mujoco."
    assert did_you_mean("xyz", []) == " Known: none."


def test_a_missing_extra_says_the_line_that_mends_it() -> None:
    error = MissingExtraError("engine 'fmu'", "fmu", "fmpy")
    assert "pip install 'trocar[fmu]'" in str(error)
    assert isinstance(error, ScenarioError)


def test_a_participant_error_says_who_when_and_why() -> None:
    error = ParticipantError("robot", 7, "it fell")
    assert str(error) == "participant 'robot' failed at step 7: it fell"
    assert (error.participant, error.step, error.cause) == ("robot", 7, "it fell")
