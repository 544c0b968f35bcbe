"""The keys of the help that move lead the tip as they say."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from tests.waiting import until
from tests.webconsole.test_browser import TIP, running
from tests.webconsole.test_led_jaw import Led

LED_ARM = Path(__file__).with_name("led_arm.yaml")
AXES = "trocar.scene.tips[0].axes.parent.matrixWorld.toArray()"
MOVES = {"ahead": "w", "back": "s", "left": "a", "right": "d", "up": "r", "down": "f"}
OTHERS = {"hold to move", "slowly", "close", "open", "roll left", "roll right"}
OTHERS |= {f"point {way}" for way in ("up", "down", "left", "right")}
SLOWLY = ("--set", "participants.hand.speed=20 mm/s", "--set", "participants.hand.turn_speed=0.4")
"""So that a busy machine, where a key is let go of late, leads the tip to no limit."""
FAR_M, REST_S = 3e-3, 0.2
SEEN = f"[trocar.framed, [...{TIP}, ...{AXES}]]"


def rest(one):
    """Wait until the tip has stood still for a while of simulated time, and return where.

    A page on a busy machine shows the same picture for long.
    """
    found = [one.page.evaluate(SEEN)]

    def rests():
        seen, before = one.page.evaluate(SEEN), found[0]
        if seen[0] < before[0] + REST_S:
            return False
        found[0] = seen
        return np.abs(np.subtract(seen[1], before[1])).max() < 2e-4

    until(rests)
    return found[0][1][:3]


def move(one, key):
    """Return the direction in which the tip moves while a key is held."""
    start = rest(one)
    one.hold(key, f"Math.hypot(...{TIP}.map((x, i) => x - {start}[i])) > {FAR_M}")
    way = np.subtract(rest(one), start)
    return way / np.linalg.norm(way)


def assert_three_pairs(ways):
    """Check that pairs are opposite, and that one pair is across the next."""
    for there, back in zip(ways[::2], ways[1::2], strict=True):
        assert there @ back < -0.9
    for one, other in combinations(ways[::2], 2):
        assert abs(one @ other) < 0.3


@pytest.mark.timeout(900)
def test_the_keys_that_move_lead_the_tip_as_the_help_says(browser, tmp_path):
    with running(tmp_path, str(LED_ARM), *SLOWLY) as (_, invite):
        one = Led(browser, invite("operator"))
        one.obey()
        said = {row.split(maxsplit=1)[1] for row in one.page.locator(".keys span").all_inner_texts()}
        assert said == MOVES.keys() | OTHERS
        moves = {name: move(one, key) for name, key in MOVES.items()}
        assert_three_pairs(list(moves.values()))
        assert moves["up"] @ [0, 0, 1] > 0.9
        one.page.keyboard.up("Space")
        assert one.errors == []
        one.context.close()
