from __future__ import annotations

import pytest
from hypothesis import given

from schemas.keys import Keys, same_session_name, topic, valid_name, valid_session_name
from tests.strategies import names


@given(names, names, names)
def test_keys_hold_roles_and_names(session: str, participant: str, port: str) -> None:
    keys = Keys(session)
    assert keys.grant == f"trocar/{session}/hub/grant"
    assert keys.status == f"trocar/{session}/hub/status"
    assert keys.ack(participant) == f"trocar/{session}/engine/{participant}/ack"
    assert keys.output("device", participant, port) == f"trocar/{session}/device/{participant}/out/{port}"
    assert keys.control("pause") == f"trocar/{session}/control/pause"
    assert keys.alive("engine", participant) == f"trocar/{session}/alive/engine/{participant}"
    assert keys.energy(f"{participant}/{port}") == f"trocar/{session}/hub/energy/{participant}/{port}"


@given(names, names, names)
def test_a_topic_is_the_key_without_root_and_session(session: str, participant: str, port: str) -> None:
    key = Keys(session).output("engine", participant, f"arm/{port}")
    assert topic(key) == f"/engine/{participant}/out/arm/{port}"


@pytest.mark.parametrize("name", ["a", "PSM1", "a_b", "Z9_"])
def test_valid_names(name: str) -> None:
    assert valid_name(name)


@pytest.mark.parametrize("name", ["", "1a", "_a", "a b", "a/b", "a.b", "a*", "**", "@a", "ä", "a\n"])
def test_invalid_names(name: str) -> None:
    assert not valid_name(name)
    assert not valid_session_name(name)


def test_a_session_may_have_hyphens_and_nothing_else_may() -> None:
    assert valid_session_name("colon-grasp")
    assert not valid_session_name("-grasp")
    assert not valid_name("colon-grasp")


def test_a_session_of_an_older_recording_has_underscores() -> None:
    assert same_session_name("colon-grasp", "colon_grasp")
    assert not same_session_name("colon-grasp", "colon")
