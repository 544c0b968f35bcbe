"""Which controller follows a hand at a page, and what keeps it from that."""

from pathlib import Path

import pytest

from hub.planning.scenario_file import load
from schemas.codec import encode
from schemas.ros import BoolMessage, StringMessage
from webconsole.followers import Follower, find_followers, find_pedals
from webconsole.source import Value

LED_ARM = Path(__file__).parent / "led_arm.yaml"
TELEOP = Follower("teleop")


def test_it_is_the_controller_that_the_hand_is_connected_to():
    scenario = load(str(LED_ARM), []).scenario
    assert find_followers(scenario, TELEOP.outlets) == {"hand": [TELEOP]}
    assert find_followers(scenario, ["teleop.following"]) == {"hand": []}
    assert find_followers(load("palpation", []).scenario, TELEOP.outlets) == {}


def test_of_a_hand_on_a_master_it_is_the_follower_of_the_master():
    scenario = load("system", ["participants.lead={kind: browser-pair, host: remote}"]).scenario
    right, left = Follower("right"), Follower("left")
    assert find_followers(scenario, [*right.outlets, *left.outlets, "right_hand.warning"]) == {
        "lead/right": [right],
        "lead/left": [left],
    }


def test_pedals_are_those_that_do_something_at_the_led_instruments():
    followers = {"left": [TELEOP, Follower("other")], "right": [Follower("other")]}
    assert find_pedals(followers, ["teleop.energy", "teleop.irrigation", "other.suction", "energy"]) == {
        "left": ["pedal", "rinse"],
        "right": ["pedal"],
    }
    assert find_pedals(followers, TELEOP.outlets) == {"left": [], "right": []}


@pytest.mark.parametrize(
    ("following", "warning", "said"),
    [
        (True, "PSM1 holds: it is not ENABLED and homed", None),
        (False, "PSM1 holds: it is not ENABLED and homed", "PSM1 holds: it is not ENABLED and homed"),
        (False, None, "'teleop' does not follow"),
        (None, None, None),
    ],
)
def test_the_last_warning_says_why_it_does_not_follow(following, warning, said):
    values = {
        TELEOP.following: None if following is None else Value(0, encode(BoolMessage(data=following))),
        TELEOP.warning: None if warning is None else Value(0, encode(StringMessage(data=warning))),
    }
    assert TELEOP.hindrance(values) == said
