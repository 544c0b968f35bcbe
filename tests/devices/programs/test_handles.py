"""Events in the order in which a handle may meet them."""

import numpy as np
import pytest

from devices.programs.handles import ArmEvents, Move
from schemas.codec import encode
from schemas.crtk import OperatingState
from schemas.errors import MotionError
from schemas.ros import BoolMessage, StringMessage
from tests.waiting import until

BUSY, IDLE = OperatingState(state="ENABLED", is_busy=True), OperatingState(state="ENABLED")
REFUSED = "PSM1: move_jp refused: joint yaw at 9 rad, allowed are -1.588 .. 1.588"
OTHER = "PSM1: move_jp refused: /python_2 may not move the arm while /python_1 commands it"


class Gateway:
    """A connection without a session: a test says what arrives."""

    node, label, start_s = "/python_1", "session 'psm'", 1.0

    def __init__(self):
        self.receivers = {}

    def listen(self, topic, receive, *, latched=False):
        self.receivers[topic.rpartition("/")[2]] = receive
        if latched:
            receive(encode(IDLE))

    def wait_for(self, holds, timeout_s):
        return until(holds)

    def say(self, *events):
        for event in events:
            if isinstance(event, OperatingState):
                self.receivers["operating_state"](encode(event))
            elif isinstance(event, bool):
                self.receivers["goal_reached"](encode(BoolMessage(data=event)))
            else:
                self.receivers["error"](encode(StringMessage(data=event)))


@pytest.fixture
def gateway():
    return Gateway()


@pytest.fixture
def move(gateway):
    return Move(ArmEvents(gateway, "PSM1"), "move_jp")


@pytest.mark.parametrize("events", [(BUSY, IDLE, True), (BUSY, True, IDLE), (BUSY, IDLE)])
def test_a_move_ends_when_the_arm_is_not_busy(gateway, move, events):
    gateway.say(*events[:-1])
    gateway.say(events[-1])
    move.wait()


def test_the_end_of_an_earlier_move_is_not_that_of_this_one(gateway, move):
    gateway.say(BUSY, IDLE, True)
    later = Move(move._events, "move_jp")
    gateway.say(IDLE, True)
    assert later.is_busy()
    gateway.say(BUSY, False)  # the controller abandons the earlier move when it accepts this one
    assert later.is_busy()
    gateway.say(IDLE, True)
    later.wait()


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0), (0, 2, 1)])
def test_a_refusal_is_raised_in_any_order_of_its_topics(gateway, move, order):
    events = (IDLE, False, REFUSED)
    gateway.say(*(events[i] for i in order))
    with pytest.raises(MotionError, match="joint yaw at 9 rad"):
        move.wait()


def test_a_refusal_of_another_program_is_not_ours(gateway, move):
    gateway.say(BUSY, OTHER, BUSY)
    assert move.is_busy()
    gateway.say(IDLE, True)
    move.wait()


def test_a_stop_and_a_fault_are_no_success(gateway, move):
    gateway.say(BUSY, IDLE, False)
    with pytest.raises(MotionError, match="abandoned before its goal"):
        move.wait()
    faulty = Move(move._events, "move_jp")
    gateway.say(BUSY, "PSM1: FAULT: tracking error", OperatingState(state="FAULT"))
    with pytest.raises(MotionError, match="FAULT: tracking error"):
        faulty.wait()


def test_events_beyond_the_kept_ones_are_not_repeated(gateway, move):
    gateway.say(*np.tile([True], 1500).tolist())
    assert len(move._events.since(0)) == 1000
    assert move._events.since(move._events.count) == []
