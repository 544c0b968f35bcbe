"""A property whose example takes a second: tried with a fifth of the examples, 4 locally and 20 in CI."""

from hypothesis import settings

__all__ = ["costly"]

costly = settings(max_examples=settings.default.max_examples // 5)
