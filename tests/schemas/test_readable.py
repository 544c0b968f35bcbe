"""Numbers and counted things as people read them."""

import pytest

from schemas.readable import counted


@pytest.mark.parametrize(("number", "said"), [(0, "0 late steps"), (1, "1 late step"), (2, "2 late steps")])
def test_one_thing_is_counted_in_the_singular(number, said):
    assert counted(number, "late step") == said
