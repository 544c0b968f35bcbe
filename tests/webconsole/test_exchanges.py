"""Instruments that a page exchanges: what is offered, and a grasp and an exchange by keys."""

from pathlib import Path

from hub.planning.scenario_file import load
from hub.planning.session_parameters import SessionParameters
from schemas.files import Files
from tests.waiting import until
from tests.webconsole.test_browser import Person, running
from webconsole.exchanges import offered_instruments

SCENARIO = Path(__file__).parent / "led_exchange.yaml"
NEEDLE_DRIVER, SCISSORS = "LARGE_NEEDLE_DRIVER:400006[..]", "ROUND_TIP_SCISSORS:400007[..]"
OPENING = """(() => {
  const [{ names, groups }] = trocar.scene.parts, finger = (side) => groups[names.indexOf(`PSM1/jaw_${side}`)]
  return finger("left").quaternion.angleTo(finger("right").quaternion)
})()"""
HELD_RAD, OPEN_RAD = 0.65, 0.9
"""Openings of the jaw: at most this with the block between the fingers, at least this without."""
PRESSED_MS = 3000
"""More than a gripper takes to close, so that the fingers press on the block."""


def offered(name, *changes):
    file = load(name, changes)
    params = SessionParameters.of_scenario(file.scenario, Files(Path.cwd()))
    return [one._asdict() for one in offered_instruments(file.scenario, params.validate_last)]


def test_a_page_is_offered_what_the_arm_may_hold():
    assert offered(str(SCENARIO)) == [
        {"device": "hand", "arm": "PSM1", "instruments": [NEEDLE_DRIVER, SCISSORS]}
    ]
    assert offered("browser") == []
    assert offered("clip-and-cut-by-hand") == [
        {
            "device": "right",
            "arm": "PSM1",
            "instruments": ["MEDIUM-LARGE_CLIP_APPLIER:420327[..]", SCISSORS],
        }
    ]


def test_keys_grasp_a_block_and_exchange_the_instrument(browser, tmp_path):
    """Scissors are refused while the block is in the jaw, and come when it is put down."""
    with running(tmp_path, str(SCENARIO)) as (_, invite):
        one = Person(browser, invite("operator"))
        one.sees("Boolean(trocar.scene?.placed)")
        one.page.get_by_role("button", name="Lead hand").click()
        one.page.get_by_text("you lead it").wait_for()
        keys, log = one.page.keyboard, one.page.locator("#lines")
        silent = one.page.get_by_text("let go of space, and press it again")

        def hold(key, happens, longer_ms=0):
            """Hold the dead-man and a key until something has happened."""

            def happened():
                if silent.is_visible():  # a busy machine held the page up
                    keys.up("Space")
                    keys.down("Space")
                return happens()

            keys.down("Space")
            keys.down(key)
            until(happened)
            one.page.wait_for_timeout(longer_ms)
            keys.up(key)

        hold("c", lambda: one.page.evaluate(OPENING) < HELD_RAD, PRESSED_MS)
        keys.press("2")
        log.get_by_text("open the jaw first").wait_for()
        hold("v", lambda: one.page.evaluate(OPENING) > OPEN_RAD)
        keys.press("2")
        one.page.get_by_text("its instrument is exchanged").first.wait_for()
        log.get_by_text("exchange done: the arm holds ROUND_TIP_SCISSORS").wait_for()
        one.page.get_by_text("moving: dead-man held").wait_for()
        one.context.close()
