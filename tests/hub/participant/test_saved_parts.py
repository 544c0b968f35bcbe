"""Saved states of several parts as one."""

from __future__ import annotations

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.participant import join_saved, split_saved
from schemas.errors import StateError


@given(st.lists(st.binary(max_size=40), max_size=5))
def test_parts_come_back(parts: list[bytes]) -> None:
    assert split_saved("arm", len(parts), join_saved(*parts)) == parts


@given(st.lists(st.binary(max_size=40), min_size=1, max_size=5), st.data())
def test_another_number_of_parts_or_bytes_is_refused(parts: list[bytes], data: st.DataObject) -> None:
    state = join_saved(*parts)
    cut = data.draw(st.integers(0, len(state) - 1))
    for count, wrong in [(len(parts) + 1, state), (len(parts) - 1, state), (len(parts), state + b"\0")]:
        with pytest.raises(StateError, match=f"participant 'arm': a saved state of {len(wrong)} bytes"):
            split_saved("arm", count, wrong)
    with pytest.raises(StateError, match="was it saved elsewhere"):
        split_saved("arm", len(parts), state[:cut])


@given(st.integers(0, 5), st.binary(max_size=80))
def test_bytes_from_anywhere_never_do_more_than_be_refused(count: int, state: bytes) -> None:
    with suppress(StateError):
        assert join_saved(*split_saved("arm", count, state)) == state
