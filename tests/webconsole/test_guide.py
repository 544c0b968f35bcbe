"""What a person picks in a picture and says on a page goes to the participant that is guided."""

import re
from types import SimpleNamespace

import pytest

from hub.planning.scenario_file import load
from hub.session.launch import plan_of
from schemas.errors import MessageError
from tests.waiting import until
from tests.webconsole.test_browser import Person, running
from webconsole.commands import Pick, Say
from webconsole.guide import guide_request, guided_participant

PICTURE = "endoscope.right/image_raw/compressed"


def test_the_participant_with_a_persons_inputs_is_guided():
    file = load("suturing-by-hand", [])
    assert guided_participant(plan_of(file.scenario, file.params)[0]) == "lead"
    assert guided_participant(SimpleNamespace(participants={})) is None


def test_a_pixel_is_a_point_in_the_frame_of_its_picture():
    asked = guide_request("lead", Pick(do="pick", picture=PICTURE, x=12.5, y=40.0))
    assert (asked.participant, asked.port) == ("lead", "operator/pick")
    assert asked.value["header"] == {"frame_id": "endoscope_right_image"}
    assert asked.value["point"] == {"x": 12.5, "y": 40.0, "z": 0.0}
    for word in ("take over", "consent 3f2a91c0"):
        said = guide_request("lead", Say(do="say", word=word))
        assert (said.port, said.value) == ("operator/command", {"data": word})


@pytest.mark.parametrize(
    ("participant", "picture", "why"),
    [(None, PICTURE, "nothing in this session is guided"), ("lead", "camera.depth", "no picture of an eye")],
)
def test_what_cannot_be_picked_is_refused(participant, picture, why):
    with pytest.raises(MessageError, match=why):
        guide_request(participant, Pick(do="pick", picture=picture, x=0.0, y=0.0))


def test_a_stitch_is_clicked_in_a_picture_and_consented_to(browser, tmp_path):
    with running(tmp_path, "suturing-by-hand") as (_, invite):
        person = Person(browser, invite("operator"))
        picture = person.page.locator("#pictures-row canvas").first
        person.sees("document.querySelector('#pictures-row canvas')?.width === 320")
        box = picture.bounding_box()

        def click(x, y):
            picture.click(position={"x": x / 320 * box["width"], "y": y / 288 * box["height"]})

        words = person.page.locator("#notice")
        consent = person.page.get_by_role("button", name="Consent")
        until(consent.is_disabled)
        assert "while the stitch is picking" in consent.get_attribute("title")
        click(187, 104)  # an entry; its exit at the same place is refused, in words too long for a picture
        click(187, 104)
        whole = person.page.locator("#guide-words")
        until(lambda: whole.inner_text().endswith("at least 2"))
        assert "refused: entry and exit are 0.0 mm apart" in whole.inner_text()
        person.page.get_by_role("button", name="Cancel").click()
        until(lambda: whole.inner_text() == "picking")
        click(187, 104)  # the row of holes that is farthest from the camera
        click(145, 104)
        until(lambda: "? PSM" in words.inner_text())
        until(consent.is_enabled)
        consent.click()
        until(lambda: words.inner_text() == "running")
        person.page.get_by_role("button", name="Take over").click()
        until(lambda: words.inner_text() == "taken over")
        viewer = Person(browser, invite("viewer"))
        viewer.sees("trocar.session?.role === 'viewer'")
        assert not viewer.page.get_by_role("button", name=re.compile("Consent")).is_visible()
        assert person.errors == viewer.errors == []
