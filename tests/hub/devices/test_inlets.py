import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hub.devices import inlets as module
from hub.devices.inlets import Inlets
from hub.transport.envelope import Stamp
from schemas.codec import decode, encode
from schemas.errors import LateError, MessageError
from schemas.ros import Float64Message, Float64MultiArray, Joy
from tests.hub.parts import Part, Stylus, into, out, plan_of

FLOAT, JOY = Float64Message.ros_type, Joy.ros_type


def inlets(clock="wall", age=0, host="hub"):
    stylus = Stylus(
        "stylus",
        out("value", type=FLOAT, clock=clock, max_age_ns=age),
        out("button", type=JOY, variability="event", clock=clock),
        out("unused"),
    )
    engine = Part(
        "engine",
        into("value", type=FLOAT),
        into("button", type=JOY, variability="event"),
        into("knob", size=2, start=(1.0, 2.0)),
    )
    return Inlets(
        plan_of(
            stylus,
            engine,
            connections=["stylus.value -> engine.value", "stylus.button -> engine.button"],
            specs={"stylus": {"host": host}},
        )
    )


def number(value):
    return encode(Float64Message(data=value))


def press(value):
    return encode(Joy(buttons=np.array([value], np.int32)))


def entering(found):
    """Return (port, number or press) of each sample; None where only the staleness changed."""
    rows = []
    for sample in found:
        payload = sample.payload.tobytes()
        value = (
            None
            if not payload
            else (
                decode(Float64Message, payload).data
                if sample.port == "value"
                else int(decode(Joy, payload).buttons[0])
            )
        )
        rows.append((sample.port, value))
    return rows


@given(
    st.lists(
        st.one_of(st.just("sample"), st.tuples(st.sampled_from(["value", "button"]), st.integers(0, 9))),
        max_size=30,
    )
)
def test_streams_keep_the_newest_and_events_all_in_order(actions):
    box, newest, presses = inlets(), None, []
    for now, action in enumerate([*actions, "sample"]):
        if action == "sample":
            expected = ([] if newest is None else [("value", newest)]) + [("button", p) for p in presses]
            assert entering(box.sample(0, now)) == expected
            newest, presses = None, []
        elif action[0] == "value":
            newest = action[1]
            box.offer("stylus", "value", number(newest), now)
        else:
            presses.append(action[1])
            box.offer("stylus", "button", press(action[1]), now)


@pytest.mark.parametrize("clock", ["wall", "simulated"])
def test_staleness_enters_once_and_so_does_its_end(clock):
    box = inlets(clock, age=10)

    def sample(now):
        return [
            (s.port, s.stale, s.payload.size > 0)
            for s in (box.sample(now, -1) if clock == "simulated" else box.sample(-1, now))
        ]

    assert sample(0) == []  # stale from the start, as the host knows
    box.offer("stylus", "value", number(1.0), 5)
    assert sample(6) == [("value", False, True)]
    assert sample(15) == []
    assert sample(16) == [("value", True, False)]
    assert sample(17) == []
    box.offer("stylus", "value", number(2.0), 20)
    assert sample(20) == [("value", False, True)]
    box.offer("stylus", "value", number(3.0), 21)
    assert sample(40) == [("value", True, True)]  # it arrived, but is too old by now


def test_a_sample_enters_with_its_age():
    box = inlets()
    box.offer("stylus", "value", number(1.0), 5)
    assert [s.age_ns for s in box.sample(0, 12)] == [7]


def test_a_sample_enters_with_the_value_that_was_decoded_to_check_it():
    box = inlets()
    box.offer("stylus", "value", number(1.5), 5)
    (entering,) = box.sample(0, 12)
    assert entering.decoded is not None
    _, value = entering.decoded
    assert value.tolist() == [1.5]


def test_a_flood_of_events_is_refused_until_the_next_communication_point(monkeypatch):
    monkeypatch.setattr(module, "_MOST_QUEUED", 3)
    box = inlets()
    for i in range(3):
        box.offer("stylus", "button", press(i), 0)
    with pytest.raises(MessageError, match="has 3 samples waiting; this one is refused"):
        box.offer("stylus", "button", press(3), 0)
    assert len(box.sample(0, 0)) == 3
    box.offer("stylus", "button", press(4), 0)
    assert entering(box.sample(0, 0)) == [("button", 4)]


@pytest.mark.parametrize(
    ("port", "payload", "message"),
    [
        ("unused", number(1.0), "no connection takes 'stylus.unused'"),
        ("value", b"", "no such message"),
        ("value", press(1), "no such message"),
        ("value", encode(Float64Message.model_construct(data=float("nan"))), "finite"),
        ("button", number(1.0), "no such message"),
    ],
)
def test_an_invalid_sample_is_refused(port, payload, message):
    box = inlets()
    with pytest.raises(MessageError, match=message):
        box.offer("stylus", port, payload, 0)
    assert box.sample(0, 0) == []


def test_an_input_without_a_connection_can_be_set():
    box = inlets()
    assert box.settable("engine", "knob").size == 2
    box.offer("engine", "knob", encode(Float64MultiArray(data=np.array([3.0, 4.0]))), 0)
    (sample,) = box.sample(0, 0)
    assert (sample.participant, sample.port, sample.stale) == ("engine", "knob", False)
    assert box.sample(0, 10**18) == []
    with pytest.raises(MessageError, match=r"'engine.value' cannot be set"):
        box.settable("engine", "value")


def test_a_late_or_repeated_sample_is_refused():
    box = inlets(host="remote")

    def offer(sequence, *, admission=1, value=0.0):
        box.offer("stylus", "value", number(value), 10**9, Stamp(admission, sequence, 10**9 - 3_000_000))

    offer(1, value=1.0)
    offer(3, value=3.0)
    for old in (3, 2):
        with pytest.raises(LateError, match=f"sample {old} of 'stylus.value' is late: 3 arrived before it"):
            offer(old)
    offer(1, admission=2, value=7.0)  # the device has joined anew
    with pytest.raises(LateError):
        offer(4)
    assert entering(box.sample(0, 10**9 + 2_000_000)) == [("value", 7.0)]
    assert box.latencies.messages() == []  # as long as the clock of its host is not known
    box.offsets_ns["stylus"] = 1_000_000
    offer(2, admission=2)
    box.sample(0, 10**9 + 2_000_000)
    (latency,) = box.latencies.messages()
    assert (latency.stream, latency.count) == ("stylus.value", 1)
    assert latency.p50_s == pytest.approx(0.004, rel=0.02)
