"""The console of a surgeon over the whole cart, as far as it takes to feel the table; and the same bits again
from its recording.
"""

import pytest

import trocar


@pytest.mark.long
def test_both_hands_lead_their_arms_and_the_right_one_feels_the_table(tmp_path):
    settings = {"duration": "2.6 s", "participants.endoscope.images": "none"}
    summary = trocar.run("teleop", set=settings, record=tmp_path / "bag", one_host=True)
    assert 0.5 < summary.measures["right_hand_force_n"] < 1.981  # at most 60 % of what a Touch can
    assert summary.dropped_messages == 0
    assert trocar.verify(tmp_path / "bag").same
