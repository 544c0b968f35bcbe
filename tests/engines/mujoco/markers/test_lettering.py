from __future__ import annotations

import string

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from engines.mujoco.markers.lettering import segments


def test_a_capital_letter_has_the_height_that_is_asked_for() -> None:
    for letter in string.ascii_uppercase:
        y = segments(letter, 6e-3)[..., 1]
        np.testing.assert_allclose([y.min(), y.max()], [-3e-3, 3e-3], atol=1e-12, err_msg=letter)


def test_every_printable_letter_of_ascii_has_strokes_of_its_own() -> None:
    seen = {segments(letter, 1.0).tobytes() for letter in map(chr, range(33, 127))}
    assert len(seen) == 94
    assert not segments(" ", 1.0).size


def test_letters_without_a_glyph_are_boxes_and_accents_are_left_out() -> None:
    assert np.array_equal(segments("\u00e9", 1.0), segments("e", 1.0))
    assert len(segments("\u6f22", 1.0)) == 4


@given(st.text(max_size=20))
def test_a_text_of_one_line_is_centred(text: str) -> None:
    line = text.replace("\n", "")
    x = segments(f"|{line}|", 1.0)[..., 0]
    np.testing.assert_allclose(x.min() + x.max(), 0.0, atol=1e-9)


def test_lines_are_below_each_other() -> None:
    first, second = segments("H\nH", 1.0)[:3], segments("H\nH", 1.0)[3:]
    np.testing.assert_allclose(first[..., 0], second[..., 0])
    assert second[..., 1].max() < first[..., 1].min()
