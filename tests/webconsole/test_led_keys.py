"""The keys of the help that move lead the tip as they say."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import yaml

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


class LedByTheRight(Led):
    """Somebody who leads the right hand of a pair."""

    device = "hand/right"


@pytest.mark.timeout(600)
def test_one_hand_of_a_pair_leads_the_arm(browser, tmp_path):
    scenario = tmp_path / "led_arm.yaml"
    text = LED_ARM.read_text().replace("kind: browser,", "kind: browser-pair,")
    scenario.write_text(text.replace("hand.", "hand.right/"))
    with running(tmp_path, str(scenario), *SLOWLY) as (_, invite):
        one = LedByTheRight(browser, invite("operator"))
        one.obey()
        assert move(one, "r") @ [0, 0, 1] > 0.9
        one.page.keyboard.up("Space")
        said = one.page.locator("#lines").inner_text()
        assert "no page leads: choose 'Lead hand/left'" in said
        assert "no page leads" not in one.page.locator("#alerts").inner_text(), "the panel says it"
        assert one.errors == []
        one.context.close()


def seen_by_an_endoscope(text):
    described = yaml.safe_load(text)
    described["scene"]["arms"]["ECM"] = {}
    camera = {"kind": "endoscope", "host": "cameras", "looks": "plain", "images": "compressed"}
    described["participants"]["endoscope"] = camera | {"period": "40 ms"}
    described["order"].append("endoscope")
    described["connections"].append("robot.qpos -> endoscope.qpos")
    return yaml.safe_dump(described)


def moves(one, pill):
    """Press the dead-man anew: the page lets go of it when a picture takes the screen."""
    one.page.keyboard.up("Space")
    one.page.keyboard.down("Space")
    one.page.wait_for_timeout(500)
    return "moving" in pill.inner_text()


@pytest.mark.timeout(600)
def test_keys_lead_in_front_of_a_picture_on_the_whole_screen(browser, tmp_path):
    """The pill is in the picture, and back in its panel when the picture is small again."""
    scenario = tmp_path / "led_arm.yaml"
    scenario.write_text(seen_by_an_endoscope(LED_ARM.read_text()))
    with running(tmp_path, str(scenario), *SLOWLY) as (_, invite):
        one = Led(browser, invite("operator"))
        one.obey()
        picture = one.page.get_by_role("img", name="Picture of endoscope.left")
        for place in ("figure:fullscreen", "#lead"):
            picture.dblclick()
            pill = one.page.locator(f"{place} #dead-man")
            pill.wait_for()
            until(lambda pill=pill: moves(one, pill))
            move(one, "f")
            one.page.keyboard.up("Space")
            until(lambda pill=pill: "press space" in pill.inner_text())
        assert one.errors == []
        one.context.close()
