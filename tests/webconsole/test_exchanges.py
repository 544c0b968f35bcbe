"""Instruments that a page offers for exchange."""

from pathlib import Path

from hub.planning.scenario_file import load
from hub.planning.session_parameters import SessionParameters
from schemas.files import Files
from webconsole.exchanges import offered_instruments

SCENARIO = Path(__file__).parent / "led_exchange.yaml"
NEEDLE_DRIVER, SCISSORS = "LARGE_NEEDLE_DRIVER:400006[..]", "ROUND_TIP_SCISSORS:400007[..]"


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
    (right,) = offered("cholecystectomy-by-hand")
    assert right["instruments"][0] == "PERMANENT_CAUTERY_HOOK:400183[..]"
    assert len(right["instruments"]) == 4
