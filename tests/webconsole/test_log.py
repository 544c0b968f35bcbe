"""Lines of the page's log."""

import pytest

from hub.participant import event_out
from schemas.codec import encode
from schemas.ros import Header
from schemas.trocar_msgs import SessionStatus, TissueEvent
from webconsole.log import Entries
from webconsole.recorded import Recorded
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


def test_late_steps_and_refused_messages_are_a_line_every_five_seconds(recording):
    """On a busy machine every status counts more of them: the other lines stay in sight."""
    source = Recorded(recording)
    statuses = [
        (
            i * 100_000_000,
            SessionStatus(
                session="busy",
                run=1,
                state="running",
                step=100 * i,
                sim_time_ns=i * 100_000_000,
                real_time_factor=0.2,
                late_steps=90 * i,
                dropped_messages=max(0, i - 2) if i < 40 else 40,
            ),
        )
        for i in range(121)
    ]
    source.__dict__["_read_statuses"] = statuses, []
    lines = [(one.time_s, one.text) for one in source.events if one.source == "session"]
    assert lines == [
        (0.1, "90 late steps"),
        (0.3, "1 message refused"),
        (5.1, "4500 late steps"),
        (5.3, "39 messages refused"),
        (10.1, "4500 late steps"),
        (12.0, "1710 late steps"),
    ]
