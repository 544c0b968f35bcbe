"""The device that a page leads: what it publishes, and when it lets go."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from devices.browser.device import Browser, BrowserParams
from devices.browser.page_hand import Obedience, PageHand, PageInput, hand_of
from devices.browser.pair import BrowserPair
from devices.keyboard.virtual_stylus import Wish
from hub.testing import check_device

MS = 1_000_000


class Page:
    """A page that leads a device which is read at 250 Hz."""

    def __init__(self):
        self.t = 0
        self.hand = PageHand(clock=lambda: self.t)
        self.device = Browser("hand", BrowserParams())
        self.device.open(Path())
        self.device._hand = self.hand

    def read(self, milliseconds):
        """Return the newest sample of each port after some time, by its name."""
        samples = {}
        for _ in range(milliseconds // 4):
            self.t += 4 * MS
            samples |= {sample.port: sample.message for sample in self.device.read(self.t)}
        return samples

    def ask(self, milliseconds, drag=(0.0, 0.0, 0.0), **wish):
        """Ask the same every 20 ms."""
        samples = {}
        for _ in range(milliseconds // 20):
            self.hand.give(PageInput(Wish(**wish), drag))
            samples |= self.read(20)
        return samples


@pytest.fixture
def page():
    return Page()


def position(samples):
    at = samples["pose"].pose.position
    return np.array([at.x, at.y, at.z])


def test_it_is_a_device():
    check_device(lambda: Browser("hand", BrowserParams()))


def test_nobody_leads_at_first(page):
    samples = page.read(100)
    assert {*samples} == {"diagnostics"}
    assert "host: remote" in samples["diagnostics"].message


def test_it_moves_as_asked(page):
    samples = page.ask(1000, linear=(1.0, 0.0, 0.0), dead_man=True)
    assert samples["buttons"].buttons.tolist() == [1, 0, 0, 0]
    assert np.allclose(position(samples), [0.1, 0, 0], atol=0.006)
    assert np.allclose(samples["twist"].twist.linear.x, 0.1)
    assert samples["diagnostics"].level == 0


def test_it_lets_go_after_silence(page):
    page.ask(200, linear=(1.0, 0.0, 0.0), dead_man=True)
    before = page.read(72)
    assert "pose" in before
    assert "buttons" not in before
    after = page.read(8)
    assert after["buttons"].buttons.tolist() == [0, 0, 0, 0]
    later = page.read(400)
    assert {*later} <= {"diagnostics"}, "no pose: the inlet is stale after its max_age"


def test_it_lets_go_when_nobody_leads(page):
    page.ask(100, dead_man=True)
    page.hand.release()
    samples = page.read(4)
    assert samples["buttons"].buttons.tolist() == [0, 0, 0, 0]
    assert "pose" not in samples


@pytest.mark.parametrize(
    "lost",
    [
        lambda page: page.read(220),
        lambda page: (page.hand.release(), page.read(4)),
        lambda page: (page.read(120), page.hand.release(), page.read(4)),
        lambda page: (page.hand.give(PageInput(Wish(), away=True)), page.read(4)),
    ],
)
def test_what_is_held_through_a_loss_has_to_be_pressed_anew(page, lost):
    here = position(page.ask(100, linear=(1.0, 0.0, 0.0), dead_man=True))
    lost(page)
    held = page.ask(100, linear=(1.0, 0.0, 0.0), dead_man=True)
    assert "buttons" not in held
    assert page.hand.obedience is Obedience.SPENT
    assert np.linalg.norm(position(held) - here) < 0.1 * 0.1 + 1e-9, "what was asked until the loss"
    page.ask(20)
    assert page.ask(20, dead_man=True)["buttons"].buttons.tolist() == [1, 0, 0, 0]


@pytest.mark.parametrize("silence_ms", [100, 140, 160])
def test_what_is_held_goes_on_after_a_silence_in_which_the_pose_was_never_stale(page, silence_ms):
    """As on a page that draws slowly: the arm holds meanwhile, and nobody has to press anew."""
    here = position(page.ask(100, linear=(1.0, 0.0, 0.0), dead_man=True))
    silent = page.read(silence_ms)
    assert silent["buttons"].buttons.tolist() == [0, 0, 0, 0]
    assert page.hand.obedience is Obedience.SILENT
    assert "diagnostics" not in silent, "no warning for each late picture"
    again = page.ask(100, linear=(1.0, 0.0, 0.0), dead_man=True)
    assert again["buttons"].buttons.tolist() == [1, 0, 0, 0]
    assert page.hand.obedience is Obedience.MOVES
    assert np.linalg.norm(position(again) - here) <= 0.1 * 0.250 + 1e-9, "no leap for the time of the silence"


def test_how_it_follows_is_said(page):
    said = []

    def note():
        said.append(page.hand.obedience)

    page.read(4), note()
    page.ask(20), note()
    page.ask(20, dead_man=True), note()
    page.read(300), note()
    page.ask(20, dead_man=True), note()
    page.ask(20), note()
    page.hand.give(PageInput(Wish(), away=True))
    samples = page.read(200)
    note()
    assert samples["diagnostics"].level == 0, "it is no fault of anything"
    page.hand.release()
    page.read(4), note()
    assert [str(one) for one in said] == ["unled", "open", "moves", "spent", "spent", "open", "away", "unled"]


def test_it_never_leaps_after_a_pause(page):
    here = position(page.ask(100, linear=(1.0, 0.0, 0.0)))
    page.t += 3_000_000_000
    there = position(page.ask(20, linear=(1.0, 0.0, 0.0)))
    assert np.linalg.norm(there - here) < 0.1 * 0.05 + 0.1 * 0.02 + 1e-9


def test_the_way_of_the_pointer_is_gone_at_the_speed_of_the_device(page):
    page.ask(20, drag=(5.0, 0.0, 0.0))
    start = position(page.ask(20, drag=(5.0, 0.0, 0.0)))
    samples = page.ask(100, drag=(5.0, 0.02, 0.0))
    assert np.allclose(position(samples) - start, [0, 0.01, 0], atol=0.001)
    samples = page.ask(400, drag=(5.0, 0.02, 0.0))
    assert np.allclose(position(samples) - start, [0, 0.02, 0], atol=1e-6)


@given(st.lists(st.tuples(*(3 * [st.floats(-1, 1)]), st.integers(1, 10)), min_size=1, max_size=6))
def test_it_is_never_faster_than_it_may_be(moves):
    page = Page()
    before = np.zeros(3)
    for x, y, z, count in moves:
        samples = page.ask(20 * count, linear=(x, y, z), drag=(z, x, y))
        now = position(samples)
        assert np.linalg.norm(now - before) <= 0.1 * (0.02 * count + 0.05) + 1e-9
        before = now


def test_a_tracked_hand_is_met_by_the_stylus_while_the_clutch_is_open(page):
    page.hand.give(PageInput(Wish(), tracked=((0.3, 0.2, 0.1), (0.0, 0.0, 0.0, 1.0))))
    samples = page.read(20)
    assert np.allclose(position(samples), [0.3, 0.2, 0.1])
    assert samples["twist"].twist.linear.x == 0.0


@pytest.mark.long
@given(
    jump=st.tuples(*[st.floats(-1.0, 1.0)] * 3),
    turn=st.floats(-3.0, 3.0),
)
def test_a_tracked_hand_that_leaps_does_not_move_the_stylus_faster_than_allowed(jump, turn):
    page = Page()
    page.hand.give(PageInput(Wish(), tracked=((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))))
    page.read(20)
    there = PageInput(
        Wish(dead_man=True), tracked=(jump, (0.0, 0.0, float(np.sin(turn / 2)), float(np.cos(turn / 2))))
    )
    page.hand.give(there)
    samples = page.read(80)
    assert np.linalg.norm(position(samples)) <= 0.1 * 0.080 + 1e-9
    twist = samples["twist"].twist
    assert np.linalg.norm([twist.angular.x, twist.angular.y, twist.angular.z]) <= 1.0 + 1e-9
    for _ in range(200):
        page.hand.give(there)
        samples = page.read(100)
    assert np.allclose(position(samples), jump, atol=1e-6), "what was too fast is caught up"


def test_an_instrument_is_asked_for_once(page):
    page.ask(20)
    page.hand.ask_for("ROUND_TIP_SCISSORS:400007[..]")
    assert page.ask(20)["set_tool_type"].data == "ROUND_TIP_SCISSORS:400007[..]"
    assert "set_tool_type" not in page.ask(100)


def test_an_instrument_asked_for_is_forgotten_with_the_lead(page):
    page.ask(20)
    page.hand.ask_for("ROUND_TIP_SCISSORS:400007[..]")
    page.hand.release()
    assert "set_tool_type" not in page.ask(100)


def test_a_pair_is_a_device_with_the_ports_of_two_styluses():
    check_device(lambda: BrowserPair("pair", BrowserParams()))
    names = {port.name for port in BrowserPair("pair", BrowserParams()).ports}
    assert {"right/pose", "right/buttons", "left/pose", "left/gripper"} <= names


def test_each_hand_of_a_pair_is_led_by_itself():
    with BrowserPair("two", BrowserParams()) as pair:
        pair.open(Path())
        pair.read(4 * MS)
        hand_of("two/left").give(PageInput(Wish(linear=(0.0, 0.0, 1.0), dead_man=True)))
        samples = pair.read(8 * MS)
        ports = {sample.port for sample in samples}
        assert {"left/pose", "left/buttons"} <= ports
        assert not {"right/pose", "right/buttons"} & ports
        hand_of("two/left").release()
