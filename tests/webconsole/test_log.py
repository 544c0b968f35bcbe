"""Lines of the page's log."""

import pytest

from hub.participant import event_out
from schemas.codec import encode
from schemas.ros import Header
from schemas.trocar_msgs import TissueEvent
from webconsole.log import Entries
from webconsole.source import Outlet, Value


@pytest.mark.parametrize(
    ("event", "level", "text"),
    [
        ({"kind": "cut", "instrument": "scissors", "size": 1.25e-5, "unit": "m^2"}, "info", "12.5 mm²"),
        ({"kind": "burnt", "instrument": "scissors", "size": 3e-9, "unit": "m^3"}, "info", "3 mm³"),
        ({"kind": "torn", "instrument": "", "size": 2e-6, "unit": "m^2"}, "warn", "2 mm²"),
    ],
)
def test_an_event_of_tissue_is_a_line(event, level, text):
    outlet = Outlet("tissue", event_out("liver/events", TissueEvent))
    value = Value(1_500_000_000, encode(TissueEvent(header=Header(), **event)))
    (entry,) = Entries().lines_of(outlet, value)
    by = " by scissors" if event["instrument"] else ""
    assert (entry.time_s, entry.level, entry.source) == (1.5, level, "tissue")
    assert entry.text == f"liver {event['kind']}{by}, {text}"
