"""Energy book of tissue of kind fem: a block is pressed, pulled, and let go.

python bench/fem_energy.py

Work of the instruments beside the stored and the lost, sub-step by sub-step, in double precision.
Results: docs/decisions/0125-tissue-of-our-own.md.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))  # for the tests' book

from tests.engines.fem.energy_book import JAW, LIFTED, Motion


def say(motion: Motion, what: str) -> None:
    """Print the book."""
    book, (lines, left) = motion.book, motion.left()
    line = ", ".join(f"{key} {1e6 * value:.2f}" for key, value in lines.items())
    late = left + (book.lagging - book.work) / motion.largest
    print(
        f"friction {book.friction}, sub-step {1e6 * book.dt:.0f} us, {what}: {line} uJ; left {left:+.3%},"
        f" with the lagging work {late:+.3%}"
    )


def main() -> None:
    """Print the book after each part of the motion."""
    for friction, finer in ((0.0, 1), (0.3, 1), (0.3, 4)):
        motion = Motion(250, friction, finer)
        motion.go((-0.02, 0.0, 2e-3), JAW, seconds=0.1)
        motion.go((-0.02, 0.0, 2e-3), JAW, seconds=0.05)
        say(motion, "pressed")
        motion.go((-0.015, 0.0, 2e-3), JAW, seconds=0.1)
        say(motion, "dragged")
        motion.take()
        motion.go((-0.015, 0.0, 8e-3), LIFTED, seconds=0.1)
        motion.go((-0.015, 0.0, 8e-3), LIFTED, seconds=0.02)
        say(motion, "pulled")
        motion.let_go()
        motion.go((-0.015, 0.0, 8e-3), LIFTED, seconds=0.3)
        say(motion, "let go")


if __name__ == "__main__":
    main()
