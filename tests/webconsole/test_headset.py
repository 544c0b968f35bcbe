"""A headset at the page: iwer (MIT, vendored) stands for the headset's browser."""

from pathlib import Path

import pytest

from devices.browser import Obedience
from tests.waiting import until
from tests.webconsole.conftest import served
from tests.webconsole.recorded_scene import write_scene
from tests.webconsole.test_browser import GAMEPAD, Person
from webconsole.pilot import Offer, Pilots
from webconsole.recorded import Recorded

IWER = Path(__file__).parent / "vendor/iwer.min.js"
WORN = """
window.headset = new IWER.XRDevice(IWER.metaQuest3)
headset.installRuntime({ forceInstall: true })
headset.position.set(0.1, 1.5, 0.2)
window.untracked = false // iwer says of every controller that its position is emulated
Object.defineProperty(XRPose.prototype, "emulatedPosition", { get: () => window.untracked })
"""

RUMBLE = """
window.felt = []
const pads = navigator.getGamepads
const playEffect = async (kind, effect) => { if (kind === "dual-rumble") felt.push(effect) }
const vibrationActuator = { playEffect }
navigator.getGamepads = () => pads().map((pad) => ({ ...pad, vibrationActuator }))
"""


class Room:
    """The devices that a page may lead, and what it asks of each."""

    def __init__(self):
        self.pilots = Pilots()
        self.given = {name: [] for name in ("head", "left_hand", "right_hand")}
        for name, given in self.given.items():
            self.pilots.offer(name, Offer(given.append, lambda: Obedience.OPEN, given.append))

    def newest(self, name):
        given = self.given[name]
        return given[-1] if given else None


@pytest.fixture
def room():
    return Room()


@pytest.fixture
def person(browser, room, tmp_path):
    write_scene(tmp_path / "scene")
    with served(Recorded(tmp_path / "scene"), room.pilots) as server:
        link = f"http://127.0.0.1:{server.port}{server.gate.invite('operator')}"
        one = Person(browser, link, IWER.read_text(), WORN)
        yield one
        one.context.close()


def test_the_force_on_the_instrument_is_felt_while_the_hand_leads(browser, tmp_path):
    """The gamepad is a stub. The force grows by 50 N/m of depth, and 2 N are felt with all strength."""
    write_scene(tmp_path / "scene")
    pilots, given = Pilots(), []
    pilots.offer("hand", Offer(given.append, lambda: Obedience.OPEN, given.append))
    with served(Recorded(tmp_path / "scene"), pilots) as server:
        link = f"http://127.0.0.1:{server.port}{server.gate.invite('operator')}"
        one = Person(browser, link, GAMEPAD, RUMBLE)
        one.sees("trocar.session?.felt[0] === 'hand'")
        instant = one.page.get_by_role("slider", name="Instant of the recording")

        def feels(*times):
            """Show instants in turn, as a force is felt for a moment, and return the last strength."""
            for time in times:
                instant.fill(time)
                one.page.wait_for_timeout(100)
            return one.page.evaluate("felt.at(-1)?.strongMagnitude")

        one.page.get_by_role("button", name="Lead hand").click()
        one.page.get_by_text("you lead it").wait_for()
        assert feels("0.8", "0.9") is None, "the dead-man is open"
        one.page.evaluate("press(-1)")
        until(lambda: given and given[-1].dead_man)
        # not at once: of the instant that was shown when the hand was pressed, all strength may be felt first
        assert until(lambda: 0.0 < (feels("0.12", "0.13") or 0.0) < 0.2)
        until(lambda: feels("0.85", "0.9") == 1)
        assert one.page.evaluate("felt.every(({ duration }) => duration === 100)")
        one.page.wait_for_timeout(200)
        count = one.page.evaluate("felt.length")
        one.page.wait_for_timeout(200)
        assert one.page.evaluate("felt.length") == count, "no new force: nothing is felt"
        one.context.close()


def test_a_head_and_two_hands_lead_while_they_are_held(person, room):
    person.sees("Boolean(trocar.scene?.placed)")
    person.page.get_by_role("button", name="Enter headset").click()
    until(lambda: all(map(room.newest, room.given)))
    head, right = room.newest("head"), room.newest("right_hand")
    assert not head.dead_man
    assert not right.dead_man
    assert len(right.tracked) == 7
    assert person.page.evaluate("trocar.headset.theatre.screens.every(({ visible }) => visible)"), "both eyes"

    person.page.evaluate("headset.controllers.right.updateButtonValue('squeeze', 1)")
    person.page.evaluate("headset.controllers.right.updateButtonValue('trigger', 1)")
    until(lambda: room.newest("right_hand").dead_man and room.newest("right_hand").gripper == -1)
    assert not room.newest("left_hand").dead_man, "the other hand's clutch is open"
    before = room.newest("right_hand").tracked
    person.page.evaluate("headset.controllers.right.position.x += 0.05")
    until(lambda: abs(room.newest("right_hand").tracked[0] - before[0] - 0.05) < 1e-3)

    person.page.evaluate("headset.controllers.left.updateButtonValue('x-button', 1)")
    until(lambda: room.newest("head").dead_man)

    person.page.evaluate("untracked = true")
    until(lambda: not room.newest("right_hand").dead_man and not room.newest("head").dead_man)
    person.page.evaluate("untracked = false")
    count = len(room.given["right_hand"])
    until(lambda: len(room.given["right_hand"]) > count + 5)
    assert not room.newest("right_hand").dead_man, "a grip that is still held is pressed anew first"

    person.page.evaluate("() => trocar.headset.session.end()")  # as by the headset's own button
    until(lambda: all(room.newest(name) is None for name in room.given))
    person.page.get_by_role("button", name="Enter headset").wait_for()
    assert person.errors == []
