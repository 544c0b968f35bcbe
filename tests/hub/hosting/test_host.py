"""One host without a network: what it requires of its participants, and its errors."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hub.hosting.host import Host
from hub.participant import Params
from hub.testing import run_in_process
from hub.transport.port_codec import PortCodec
from schemas.errors import ParticipantError, StateError
from schemas.lockstep import Entering, Grant
from schemas.ros import Float64Message
from tests.hub.parts import Part, into, out, plan_of

MS = 1_000_000


class Scripted(Part):
    """Returns one item of a list after the other; an exception in it is raised."""

    def __init__(self, name, items, *ports):
        super().__init__(name, *ports)
        self._items = list(items)
        self.closed = 0

    def configure(self, setup):
        return self.step(0, 0, None)

    def step(self, t, h, inputs):
        item = self._items.pop(0)
        if isinstance(item, Exception):
            raise item
        return item

    def close(self):
        self.closed += 1
        if self.closed == 1:
            raise OSError("stuck")


def host_of(*parts, **scenario):
    return Host("hub", plan_of(*parts, **scenario), {part.name: part for part in parts})


def run(host, steps, start=0):
    reports = []
    host.run(
        Grant(1, 0, start, start * MS, (start + steps) * MS),
        lambda planned, ack: reports.append((planned.name, ack)),
    )
    return reports


def test_a_sample_that_this_process_has_decoded_is_not_decoded_again():
    given = []

    class Reads(Scripted):
        def step(self, t, h, inputs):
            given.append(None if inputs is None else inputs["in"])
            return super().step(t, h, inputs)

    host = host_of(Reads("reader", [{}, {}, {}], into("in", start=(0.0,))))
    host.configure(Path())
    codec, value = PortCodec(into("in", start=(0.0,))), np.array([2.0])
    payload = np.frombuffer(codec.encode(np.array([1.0]), 0), np.uint8)
    others = PortCodec(into("in", size=2)).layout
    for step, decoded in enumerate(((codec.layout, value), (others, value))):
        sample = Entering("reader", "in", False, payload, 0, decoded)
        host.run(Grant(1, 0, step, step * MS, (step + 1) * MS, [sample]), lambda *_: None)
    assert given[1] is value
    assert given[2].tolist() == [1.0]


GOOD = {"out": np.zeros(2)}


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({}, "output 'out' is missing"),
        ({"out": np.zeros(3)}, r"port 'out': float64 of shape \(3,\), expected float64 of shape \(2,\)"),
        ({"out": np.array([0.0, np.inf])}, "not all of"),
        ({"out": [0.0, 0.0]}, r"port 'out': a list, expected float64 of shape \(2,\): numpy.array"),
        ({"out": np.array([1, 2])}, r"port 'out': int64 of shape \(2,\), expected float64"),
        (ZeroDivisionError("no mass"), "ZeroDivisionError: no mass"),
        (StateError("no state"), "no state"),
    ],
)
def test_an_invalid_output_is_reported_with_participant_and_step(bad, message):
    port = out(size=2)
    with pytest.raises(ParticipantError, match=message) as raised:
        host_of(Scripted("a", [bad], port)).configure(Path())
    assert (raised.value.participant, raised.value.step) == ("a", -1)
    host = host_of(Scripted("a", [GOOD, GOOD, GOOD, bad], port))
    host.configure(Path())
    with pytest.raises(ParticipantError, match=message) as raised:
        run(host, 5)
    assert (raised.value.participant, raised.value.step) == ("a", 2)


def test_an_output_is_needed_only_when_it_is_due():
    host = host_of(Scripted("a", [GOOD, {}, {}, GOOD, {}, {}, GOOD], out(size=2, period_ns=3 * MS)))
    host.configure(Path())
    assert len(run(host, 6)[0][1].state_hash) == 6


def test_every_participant_is_closed_even_if_others_raise(caplog):
    parts = [Scripted(name, []) for name in "ab"]
    host_of(*parts).close()
    assert [part.closed for part in parts] == [1, 1]
    assert caplog.text.count("raised while it was closed") == 2


def test_reports_hold_the_steps_that_each_took():
    parts = [Part("one"), Part("three")]
    host = host_of(*parts, specs={"three": {"period": "3 ms"}})
    host.configure(Path())
    assert [(name, len(ack.state_hash)) for name, ack in run(host, 4)] == [("one", 4), ("three", 2)]
    assert [(name, len(ack.state_hash)) for name, ack in run(host, 2, start=4)] == [("one", 2)]
    assert [(name, len(ack.compute_ns)) for name, ack in run(host, 1, start=6)] == [
        ("one", 1),
        ("three", 1),
    ]
    assert host.due(7, 2) == ["one"]
    assert host.due(7, 3) == ["one", "three"]


def test_the_participant_that_is_waited_for_is_known_by_name():
    seen = []

    class Curious(Part):
        def step(self, t, h, inputs):
            seen.append(host.awaited)
            return {}

    host = host_of(Curious("a"), Curious("b"))
    host.configure(Path())
    run(host, 2)
    assert seen == ["a", "b", "a", "b"]
    assert host.awaited is None


class Ramp(Part):
    """Gives the time (s) at the end of each step."""

    params_model = Params

    def __init__(self, name):
        super().__init__(name, out(unit="s"))

    def configure(self, setup):
        self.t = np.zeros(1)
        return {"out": self.t}

    def step(self, t, h, inputs):
        self.t[0] = (t + h) * 1e-9  # in place, as engines may
        return {"out": self.t}


class Probe(Part):
    """Notes what it sees of one input."""

    def __init__(self, name):
        super().__init__(name, into(unit="s"))
        self.seen = []

    def step(self, t, h, inputs):
        self.seen.append((inputs["in"][0], inputs.at("in", 0.5 * h * 1e-9)[0]))
        return {}


class Inbox(Part):
    """Notes the messages that each of its steps finds on an event port."""

    def __init__(self, name, **rest):
        super().__init__(name, into(variability="event", **rest))
        self.seen = []

    def step(self, t, h, inputs):
        self.seen.append(inputs.events("in"))
        return {}


@pytest.mark.parametrize(("algorithm", "late"), [("gauss-seidel", 0), ("jacobi", 1)])
@pytest.mark.parametrize(("source_ms", "target_ms"), [(1, 1), (2, 1), (1, 3), (4, 2), (2, 4)])
def test_each_new_value_of_a_signal_is_one_message_of_an_event_port(algorithm, late, source_ms, target_ms):
    inbox = Inbox("inbox", unit="s")
    periods = {"ramp": {"period": f"{source_ms} ms"}, "inbox": {"period": f"{target_ms} ms"}}
    run_in_process(
        {
            "name": "ramp",
            "step": "1 ms",
            "duration": "12 ms",
            "algorithm": algorithm,
            "participants": periods,
            "connections": ["ramp.out -> inbox.in"],
        },
        {"ramp": Ramp("ramp"), "inbox": inbox},
    )
    expected, sent = [], 0
    for step in range(0, 12, target_ms):
        ready = (step if late else step + source_ms) // source_ms
        expected.append([pytest.approx(1e-3 * source_ms * n) for n in range(sent + 1, ready + 1)])
        sent = ready
    assert [[message.data[0] for message in messages] for messages in inbox.seen] == expected


def test_a_message_made_of_a_signal_has_stamp_frame_and_names():
    class Arm(Part):
        def configure(self, setup):
            return {"out": np.array([0.0, 0.0])}

        def step(self, t, h, inputs):
            return {"out": np.array([1.0, t * 1e-9])}

    joints = {"type": "sensor_msgs/msg/JointState", "names": ("x", "y")}
    inbox = Inbox("inbox", type=joints["type"], frame="PSM1_base")
    run_in_process(
        {"name": "arm", "step": "1 ms", "duration": "2 ms", "connections": ["arm.out -> inbox.in"]},
        {"arm": Arm("arm", out(**joints)), "inbox": inbox},
    )
    (first,), (second,) = inbox.seen
    assert (first.name, first.header.frame_id, first.header.stamp.nanosec) == (
        ["x", "y"],
        "PSM1_base",
        1 * MS,
    )
    assert (second.position.tolist(), second.header.stamp.nanosec) == ([1.0, 1e-3], 2 * MS)


def test_an_event_port_receives_all_of_its_sources_in_the_order_of_the_connections():
    inbox = Inbox("inbox", unit="s")
    scenario = {
        "name": "two",
        "step": "1 ms",
        "duration": "2 ms",
        "connections": ["slow.out -> inbox.in", "quick.out -> inbox.in"],
    }
    scenario["participants"] = {"slow": {"period": "2 ms"}}
    run_in_process(scenario, {"slow": Ramp("slow"), "quick": Ramp("quick"), "inbox": inbox})
    assert [[message.data[0] for message in messages] for messages in inbox.seen] == [
        [pytest.approx(2e-3), pytest.approx(1e-3)],
        [pytest.approx(2e-3)],
    ]


@pytest.mark.parametrize(("algorithm", "late"), [("gauss-seidel", 0), ("jacobi", 1)])
def test_a_neighbour_in_this_process_sees_values_of_the_right_step(algorithm, late):
    probe = Probe("probe")
    run_in_process(
        {
            "name": "ramp",
            "step": "1 ms",
            "duration": "6 ms",
            "algorithm": algorithm,
            "connections": ["ramp.out -> probe.in"],
        },
        {"ramp": Ramp("ramp"), "probe": probe},
    )
    assert [now for now, _ in probe.seen] == pytest.approx([1e-3 * (step + 1 - late) for step in range(6)])


def test_a_linear_connection_follows_the_source_inside_the_step():
    probe = Probe("probe")
    run_in_process(
        {
            "name": "ramp",
            "step": "1 ms",
            "duration": "8 ms",
            "algorithm": "jacobi",
            "participants": {"ramp": {"period": "2 ms"}},
            "connections": [{"source": "ramp.out", "target": "probe.in", "extrapolation": "linear"}],
        },
        {"ramp": Ramp("ramp"), "probe": probe},
    )
    exact = [(1e-3 * step, 1e-3 * step + 0.5e-3) for step in range(8)]
    # before its second value it can only hold
    np.testing.assert_allclose(probe.seen[2:], exact[2:], atol=1e-12)


class Counter(Part):
    """Counts its steps in an array that stays the same one, and says so at every other step."""

    def __init__(self, name, **rest):
        super().__init__(name, out(**rest), out("said", variability="event", type="std_msgs/msg/Float64"))
        self.count = np.zeros((1, 2))[:, 0]  # not contiguous with what stands beside it

    def _outputs(self):
        said = () if self.count[0] % 2 else (Float64Message(data=self.count[0]),)
        return {"out": self.count, "said": said}

    def configure(self, setup):
        return self._outputs()

    def step(self, t, h, inputs):
        self.count[0] += 1.0
        return self._outputs()


class Reader(Part):
    """Notes a value, and messages."""

    def __init__(self, name):
        super().__init__(name, into(), into("heard", variability="event", type="std_msgs/msg/Float64"))
        self.values, self.messages = [], []

    def step(self, t, h, inputs):
        self.values.append(float(inputs["in"][0]))
        self.messages.append([message.data for message in inputs.events("heard")])
        return {}


@pytest.mark.parametrize("order", [["counter", "reader"], ["reader", "counter"]])
def test_a_value_that_is_published_less_often_than_it_changes_is_seen_as_it_was_then(order):
    reader = Reader("reader")
    scenario = {
        "name": "slow",
        "step": "1 ms",
        "duration": "7 ms",
        "order": order,
        "connections": ["counter.out -> reader.in", "counter.said -> reader.heard"],
    }
    run_in_process(scenario, {"counter": Counter("counter", period_ns=3 * MS), "reader": reader})
    late = order[0] == "reader"
    assert reader.values == [3.0 * ((step + 1 - late) // 3) for step in range(7)]
    said = [[float(n)] if n and n % 2 == 0 else [] for n in range(8)]
    assert reader.messages == said[:7] if late else said[1:8]


def test_a_participant_knows_which_of_its_outputs_nobody_uses():
    class Listeners:
        def listener(self, planned, port):
            return None

        def vectors_listener(self, planned, ports):
            return None

        def watches(self, participant, port):
            return port == "measured"

    one = Scripted("one", 3 * [dict.fromkeys(("read", "measured", "idle"), np.zeros(1))])
    one.ports = (out("read"), out("measured"), out("idle"))
    two = Part("two", into("in"))
    plan = plan_of(one, two, connections=["one.read -> two.in"])
    host = Host("hub", plan, {"one": one, "two": two}, listeners=Listeners())
    host.configure(Path())
    assert one.unread == frozenset()
    run(host, 1)
    assert one.unread == {"idle"}
    # somebody subscribes
    host._hosted[0].ports[2].publisher = SimpleNamespace(needed=True)
    host._wire = SimpleNamespace(changes=1, noted=0, flush=lambda: None)
    run(host, 1, start=1)
    assert (one.unread, host._wire.noted) == (frozenset(), 1)
