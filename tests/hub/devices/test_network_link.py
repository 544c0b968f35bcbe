import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hub.devices.network_link import NetworkLink, NetworkLinkOrder, describe_link
from schemas.network_link import PRESETS, NetworkLinkSpec
from tests.hub.parts import into, out

MS = 1_000_000
SIGNAL, EVENTS, BACK = out("pose"), out("buttons", variability="event"), into("contact")
MILLISECONDS = st.integers(0, 50).map(lambda ms: ms / 1000)
SPECS = st.builds(
    NetworkLinkSpec,
    delay=MILLISECONDS,
    jitter=MILLISECONDS,
    loss=st.floats(0.0, 0.9),
    outages=st.lists(
        st.fixed_dictionaries({"at": MILLISECONDS, "duration": MILLISECONDS.map(lambda s: s + 0.001)}),
        max_size=2,
    ).map(tuple),
    seed=st.integers(0, 5),
)


def travel(line, count=200, period=MS):
    """Send a message each period; return (number, arrival) in the order of arrival."""
    for i in range(count):
        line.send(i * period, i)
    return [(message, arrival) for arrival, message in line.pop_arrivals(10**15)]


@given(SPECS)
def test_signals_may_be_lost_or_overtaken_but_their_delay_is_bounded(spec):
    arrived = travel(NetworkLink(spec).line(SIGNAL))
    assert len({message for message, _ in arrived}) == len(arrived) <= 200
    assert [time for _, time in arrived] == sorted(time for _, time in arrived)
    for message, arrival in arrived:
        assert spec.delay <= arrival - message * MS <= spec.delay + spec.jitter
        assert not any(outage.at <= message * MS < outage.at + outage.duration for outage in spec.outages)


@given(SPECS)
def test_events_all_arrive_in_order(spec):
    arrived = travel(NetworkLink(spec).line(EVENTS))
    assert [message for message, _ in arrived] == list(range(200))
    assert all(arrival - message * MS >= spec.delay for message, arrival in arrived)
    for outage in spec.outages:
        assert all(
            arrival >= outage.at + outage.duration + spec.delay
            for m, arrival in arrived
            if outage.at <= m * MS < outage.at + outage.duration
        )


@given(SPECS)
def test_arrivals_depend_on_seed_port_and_direction_alone(spec):
    alone, busy = NetworkLink(spec), NetworkLink(spec)
    busy.line(EVENTS).send(0, "another port's message")
    travel(busy.line(BACK), 17)
    assert travel(alone.line(SIGNAL)) == travel(busy.line(SIGNAL))


def test_loss_is_as_frequent_as_specified():
    spec, n = NetworkLinkSpec(loss=0.1, delay="10 ms", jitter="4 ms"), 20_000
    arrived = travel(NetworkLink(spec).line(SIGNAL), n)
    assert len(arrived) / n == pytest.approx(0.9, abs=4 * math.sqrt(0.09 / n))
    extra = [(arrival - m * MS - 10 * MS) / (4 * MS) for m, arrival in arrived]
    assert sum(extra) / len(extra) == pytest.approx(0.5, abs=4 * math.sqrt(1 / 12 / n))
    # sent again
    late = [a - m * 10**9 > 20 * MS for m, a in travel(NetworkLink(spec).line(EVENTS), n, period=10**9)]
    assert sum(late) / n == pytest.approx(0.1, abs=4 * math.sqrt(0.09 / n))


def test_a_link_can_be_changed_while_messages_are_on_their_way():
    link = NetworkLink(None)
    line = link.line(SIGNAL)
    assert link.clear
    assert link.idle
    line.send(0, "at once")
    assert list(line.pop_arrivals(0)) == [(0, "at once")]
    link.order(NetworkLinkOrder(spec=NetworkLinkSpec(delay="100 ms")))
    assert link.clear
    link.settle(MS)
    line.send(MS, "slow")
    link.order(NetworkLinkOrder(spec=NetworkLinkSpec(), outage_ns=10 * MS))
    link.settle(2 * MS)
    line.send(11 * MS, "lost")
    line.send(12 * MS, "after the outage")
    assert not link.clear
    assert not link.idle
    assert list(line.pop_arrivals(200 * MS)) == [(12 * MS, "after the outage"), (101 * MS, "slow")]


def test_a_link_in_words():
    assert describe_link(NetworkLinkSpec()) == ""
    assert (
        describe_link(NetworkLinkSpec(preset="70 ms", jitter="2 ms", loss=0.01), 3 * 10**9)
        == "70 ms each way, up to 2 ms more, 1 % lost, nothing at all for 3 s"
    )


def test_overlapping_outages_are_one():
    link = NetworkLink(
        NetworkLinkSpec(outages=({"at": 0.005, "duration": 0.01}, {"at": 0.0, "duration": 0.01}))
    )
    assert [link.cut_until(ms * MS) // MS for ms in (0, 9, 10, 14, 15)] == [15, 15, 15, 15, 15]
    assert link.cut_until(16 * MS) == 16 * MS


def test_network_links_in_a_scenario():
    assert [NetworkLinkSpec(preset=f"{ns // MS} ms").delay_ns for ns in PRESETS] == list(PRESETS)
    assert NetworkLinkSpec.model_validate({"delay": "7 ms", "jitter": "1 ms"}).delay_ns == 7 * MS
    with pytest.raises(
        ValidationError,
        match=(
            r"150 ms is no preset; these are 0 ms, 70 ms, 100 ms, 200 ms, 300 ms, 500 ms\."
            " For any other delay, use 'delay'"
        ),
    ):
        NetworkLinkSpec(preset="150 ms")
    with pytest.raises(ValidationError, match="a preset or a delay, not both"):
        NetworkLinkSpec(preset="100 ms", delay="100 ms")
    for wrong in (
        {"loss": 1.0},
        {"delay": -1},
        {"jitter": -1},
        {"outages": [{"at": 0, "duration": 0}]},
        {"colour": "red"},
    ):
        with pytest.raises(ValidationError):
            NetworkLinkSpec.model_validate(wrong)
