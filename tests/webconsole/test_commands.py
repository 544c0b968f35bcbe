"""What a page sends is checked before it is used."""

import json

import pytest

from devices.browser import Obedience
from schemas.errors import MessageError
from webconsole.commands import At, Hand, command
from webconsole.pilot import Offer, Pilots


def test_commands_are_read():
    assert command('{"do": "at", "time": 1.5}') == At(do="at", time=1.5)
    assert command('{"do": "hand", "number": 1, "linear": [1, 0, -1]}').linear == (1.0, 0.0, -1.0)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "null",
        '{"do": "format"}',
        '{"do": "at"}',
        '{"do": "at", "time": NaN}',
        '{"do": "at", "time": 1e400}',
        '{"do": "at", "time": "1"} ',
        '{"do": "hand", "number": 1, "linear": [1, 0]}',
        '{"do": "hand", "number": 1, "linear": [1.5, 0, 0]}',
        '{"do": "hand", "number": -1}',
        '{"do": "hand", "number": 1, "secret": 1}',
        '{"do": "step", "steps": 0}',
        '{"do": "pick", "picture": "endoscope.left/image_raw", "x": -1, "y": 0}',
        '{"do": "pick", "picture": "endoscope.left/image_raw", "x": NaN, "y": 0}',
        '{"do": "say", "word": "Consent; now"}',
        "[" * 5000,
        json.dumps({"do": "show", "numbers": ["x"] * 25}),
        json.dumps({"do": "watch", "session": "x" * 20000}),
    ],
)
def test_anything_else_is_refused(text):
    with pytest.raises(MessageError):
        command(text)


@pytest.fixture
def pilots():
    pilots = Pilots()
    pilots.given = []
    pilots.offer("hand", Offer(pilots.given.append, lambda: Obedience.OPEN, pilots.given.append))
    return pilots


def hand(number, **asked):
    return Hand(do="hand", number=number, **asked)


def test_a_device_has_one_pilot(pilots):
    pilots.lead("first", "hand")
    with pytest.raises(MessageError, match="page 1 leads 'hand'"):
        pilots.lead("second", "hand")
    with pytest.raises(MessageError, match="leads no device"):
        pilots.pass_on("second", hand(0))
    assert pilots.state("second") == [{"device": "hand", "pilot": "page 1"}]
    pilots.leave("first")
    pilots.lead("second", "hand")
    assert pilots.state("second") == [{"device": "hand", "pilot": "you"}]


def test_inputs_that_are_old_are_refused(pilots):
    pilots.lead("page", "hand")
    pilots.pass_on("page", hand(3, dead_man=True))
    with pytest.raises(MessageError, match="input 3 is old"):
        pilots.pass_on("page", hand(3))
    assert pilots.given == [hand(3, dead_man=True)]


def test_who_leaves_lets_go(pilots):
    pilots.lead("page", "hand")
    pilots.pass_on("page", hand(0, dead_man=True))
    pilots.leave("page")
    assert pilots.given[-1] is None
    pilots.lead("page", "hand")
    pilots.pass_on("page", hand(0))  # it counts from the beginning


def test_a_silent_page_loses_its_lease(pilots, monkeypatch):
    now = 100.0
    monkeypatch.setattr("webconsole.pilot.monotonic", lambda: now)
    pilots.lead("page", "hand")
    now = 102.9
    assert pilots.state("other") == [{"device": "hand", "pilot": "page 1"}]
    now = 103.1
    pilots.lead("other", "hand")


def test_another_session_has_other_devices(pilots):
    pilots.lead("page", "hand")
    pilots.keep(["stylus"])
    assert pilots.given == [None]
    assert pilots.state("page") == []


def test_an_unknown_device_is_named(pilots):
    with pytest.raises(MessageError, match="Did you mean 'hand'"):
        pilots.lead("page", "hands")


def test_a_headset_leads_several(pilots):
    pilots.offer("head", Offer(pilots.given.append, lambda: Obedience.OPEN, pilots.given.append))
    pilots.lead("page", "hand")
    pilots.lead("page", "head", beside=True)
    asked = hand(0, device="head", tracked=(0, 1, 0, 0, 0, 0, 1))
    pilots.pass_on("page", asked)
    assert pilots.given == [asked]
    with pytest.raises(MessageError, match="does not lead 'eyes'"):
        pilots.pass_on("page", hand(1, device="eyes"))


def test_who_leads_a_device_asks_for_an_instrument(pilots):
    asked = command('{"do": "exchange", "device": "hand", "instrument": "ROUND_TIP_SCISSORS:400007[..]"}')
    pilots.lead("page", "hand")
    pilots.exchange("page", asked.device, asked.instrument)
    assert pilots.given == ["ROUND_TIP_SCISSORS:400007[..]"]
    with pytest.raises(MessageError, match="does not lead 'hand'"):
        pilots.exchange("other", asked.device, asked.instrument)
    with pytest.raises(MessageError, match="does not lead 'head'"):
        pilots.exchange("page", "head", asked.instrument)
