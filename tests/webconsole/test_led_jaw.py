"""Keys of the page close a jaw on something, carry it, and exchange the instrument."""

from pathlib import Path

import pytest

from tests.waiting import until
from tests.webconsole.test_browser import Person, running

LED_EXCHANGE = Path(__file__).parent / "led_exchange.yaml"
HEIGHT = "trocar.scene.parts[0].groups[trocar.scene.parts[0].names.indexOf('block')].position.z"
HELD_BY = "Number(document.querySelector('.plot:last-child .legend b')?.textContent)"


class Led(Person):
    """Somebody who leads the arm, and does what the page asks for."""

    device = "hand"

    def lead(self):
        self.sees("Boolean(trocar.scene?.placed)")
        self.page.get_by_role("button", name=f"Lead {self.device}").click()
        self.page.locator("#dead-man").wait_for()

    def obey(self, *keys):
        """Lead on, with keys held: on a busy machine the page is silent for too long now and then."""
        said = self.page.evaluate("document.getElementById('dead-man')?.textContent")
        if said and "let go of" not in said:
            return
        for key in ("Space", *keys):
            self.page.keyboard.up(key)
        if not said:
            self.lead()
        for key in ("Space", *keys):
            self.page.keyboard.down(key)

    def hold(self, key, expression):
        """Hold a key until an expression of the page is true."""

        def done():
            self.obey(key)
            return self.page.evaluate(expression)

        self.page.keyboard.down(key)
        until(done)
        self.page.keyboard.up(key)

    def ask_for_scissors(self, answer):
        """Press the key of the second instrument until the log has the answer."""

        def answered():
            self.obey()
            self.page.keyboard.press("2")
            self.page.wait_for_timeout(500)
            return answer in self.page.locator("#lines").inner_text()

        until(answered)


@pytest.mark.timeout(600)
def test_keys_grasp_lift_and_put_down_and_get_scissors(browser, tmp_path):
    with running(tmp_path, str(LED_EXCHANGE)) as (_, invite):
        one = Led(browser, invite("operator"))
        one.obey()
        port = one.page.get_by_label("Add a port")
        port.fill("robot.block/held_by")
        port.press("Enter")
        lying = one.page.evaluate(HEIGHT)
        one.hold("c", f"{HELD_BY} === 1")
        one.hold("r", f"{HEIGHT} > {lying + 0.008}")
        one.ask_for_scissors("open the jaw first")
        one.hold("v", f"{HELD_BY} === 0 && {HEIGHT} < {lying + 0.003}")
        one.ask_for_scissors("exchange done: the arm holds ROUND_TIP_SCISSORS")
        assert one.errors == []
        one.context.close()
