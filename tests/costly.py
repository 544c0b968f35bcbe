"""A property whose example takes a second: tried with a fifth of the examples, 4 locally and 20 in CI."""

import pytest
from hypothesis import settings

__all__ = ["costly"]


def costly(test):
    """Decorate a property of `given`; the limit is for 20 examples beside other tests."""
    fewer = settings(max_examples=settings.default.max_examples // 5)
    return pytest.mark.timeout(900)(fewer(test))
