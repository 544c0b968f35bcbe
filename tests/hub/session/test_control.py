"""A running session steered from another one: pause, resume, step, set, shutdown, join, status."""

import threading
from contextlib import contextmanager

import pytest

from hub.remote.hub_connection import reach
from hub.remote.live_sessions import live_sessions
from hub.session.run_state import RunState
from hub.transport.control_client import ask
from hub.transport.control_messages import Empty, JoinReply, JoinRequest, Refusal, SetRequest, StepRequest
from schemas.codec import decode, encode
from schemas.errors import ConnectError, MessageError, SessionError
from schemas.keys import Keys
from schemas.ros import StringMessage
from tests.waiting import until

SCENARIO = """\
name: steered
step: 1 ms
participants:
  here: {kind: "toys:Paced", milliseconds: 0.2}
  there: {kind: "toys:Mixer", host: other}
connections:
  - here.out -> there.a
"""
KEYS = Keys("steered")


class Console:
    """A client of a session that runs in another thread, until it is shut down or has all its steps."""

    def __init__(self, session, client, thread):
        self.session, self._client, self._thread = session, client, thread

    def ask(self, verb, request=None, reply=Empty):
        return ask(self._client, KEYS.control(verb), request or Empty(), reply)

    @property
    def status(self):
        (status,) = live_sessions([self.session.endpoint])
        return status

    def until(self, true):
        """Wait for a status of which something is true."""
        return until(lambda: status if true(status := self.status) else None)

    def wait_for_the_end(self):
        self._thread.join()


@pytest.fixture
def steer(prepare):
    @contextmanager
    def steer(*overrides, paused=False):
        session = prepare(SCENARIO, *overrides)
        if paused:
            session.state.pause()
        outcome = []
        thread = threading.Thread(target=lambda: outcome.append(session.run()))
        thread.start()
        try:
            until(
                lambda: any(
                    status.state == "paused" if paused else status.step
                    for status in live_sessions([session.endpoint])
                )
            )
            with reach(session.endpoint, "console") as client:
                yield Console(session, client, thread), outcome
        finally:
            session.state.shutdown()
            thread.join()

    return steer


def test_pause_step_resume_and_shutdown(steer):
    with steer("window=10") as (console, outcome):
        console.ask("pause")
        status = console.until(lambda s: s.state == "paused")
        assert console.status.step == status.step
        console.ask("step", StepRequest(steps=7))
        assert console.until(lambda s: s.state == "paused" and s.step > status.step).step == status.step + 7
        console.ask("step", StepRequest(steps=2))
        console.ask("step")
        assert console.until(lambda s: s.step == status.step + 10)
        console.ask("resume")
        console.until(lambda s: s.state == "running" and s.step > status.step + 50)
        console.ask("shutdown")
        console.wait_for_the_end()
    assert outcome[0].state == "done"


def test_pausing_at_any_moment_makes_no_empty_grant(steer):
    with steer() as (console, outcome):
        for _ in range(30):
            console.ask("pause")
            console.ask("resume")
    assert outcome[0].state == "done"


def test_set_changes_an_input_without_a_connection(steer, prepare):
    def hash_with(*requests):
        with steer("duration=300 ms", paused=True) as (console, outcome):
            for request in requests:
                console.ask("set", request)
            console.ask("resume")
            console.wait_for_the_end()
        return outcome[0].state_hash

    assert hash_with(SetRequest(participant="there", port="b", value=[0.5, 0.25, 0.125])) != hash_with()


def test_what_cannot_be_set_is_refused_with_the_reason(steer):
    with steer() as (console, outcome):
        for port, value, message in (
            ("a", [0, 0, 0], "'there.a' cannot be set"),
            ("d", [0, 0, 0], "Did you mean 'there."),
            ("b", [0, 0], "expected float64 of shape"),
            ("b", "much", "could not convert"),
            ("b", [0, 0, 10**400], "too large"),
            ("b", [0, None, 0], "not all of"),
        ):
            with pytest.raises(MessageError, match=message):
                console.ask("set", SetRequest(participant="there", port=port, value=value))
    assert outcome[0].state == "done"


def test_a_request_of_any_length_is_quoted_in_part(steer):
    long = 30_000 * "x"
    with steer(paused=True) as (console, _):
        for text in ('{"steps": "' + long + '"}', long, 30_000 * "[", '{"' + long + '": 1}'):
            payload = encode(StringMessage(data=text))
            (reply,) = console._client.get(KEYS.control("step"), payload=payload)
            refusal = Refusal.model_validate_json(decode(StringMessage, reply.ok.payload.to_bytes()).data)
            assert len(refusal.refused.split()) > 2
            assert len(refusal.refused) <= 1_000


def test_what_is_no_name_of_a_host_may_not_join(steer):
    with steer(paused=True) as (console, _):
        for host in ("", "/", "a//b", "/dev/zero", "a b#$*", "remote/"):
            request = JoinRequest.model_construct(host=host, pid=1)
            with pytest.raises(MessageError, match="host: String should match"):
                ask(console._client, KEYS.join("other"), request, JoinReply)


def test_unknown_hosts_may_not_join(steer):
    with steer() as (console, _):
        for host, message in (
            ("nowhere", "has no host 'nowhere'; it has other"),
            ("hub", "no host 'hub'"),
            ("other", "has joined already, as process"),
        ):
            with pytest.raises(MessageError, match=message):
                console.ask(f"join/{host}", JoinRequest(host=host, pid=1), JoinReply)


def test_a_host_joins_under_its_own_name_and_need_not_know_the_session(steer):
    with steer() as (console, _):
        with pytest.raises(
            MessageError,
            match=(
                "belongs on trocar/steered/control/join/there,"
                " and was sent on trocar/steered/control/join/other"
            ),
        ):
            console.ask("join/other", JoinRequest(host="there", pid=1), JoinReply)
        with pytest.raises(MessageError, match="has joined already, as process"):
            ask(console._client, Keys("*").join("other"), JoinRequest(host="other", pid=1), JoinReply)


def test_status_has_the_host_of_each_participant(steer):
    with steer() as (console, _):
        console.ask("pause")
        status = console.until(lambda s: s.state == "paused")
        here, there = status.participants
    assert (status.session, here.name, here.host, there.name, there.host) == (
        "steered",
        "here",
        "hub",
        "there",
        "other",
    )
    assert here.pid != there.pid
    assert here.step == there.step == status.step - 1
    assert status.sim_time_ns == status.step * 1_000_000


def test_a_session_that_does_not_exist_does_not_answer(steer):
    with steer() as (console, _), pytest.raises(ConnectError, match="is the hub running"):
        ask(console._client, Keys("other").control("pause"), Empty(), Empty, timeout_s=0.5)


def test_shutdown_while_a_host_has_not_joined(prepare):
    session = prepare(SCENARIO, "participants.there.host=remote")
    session.state.shutdown()
    with pytest.raises(SessionError, match="shut down while waiting for remote/there to join"):
        session.run()


def test_the_budget_of_steps():
    state = RunState()
    assert (state.budget, state.wait(0.0)) == (None, True)
    state.step(3)
    state.step(2)
    assert state.budget == 5
    state.spend(4)
    assert state.budget == 1
    state.spend(2)  # a grant of a window may not exceed the budget, but the count never goes below zero
    assert state.budget == 0
    assert not state.wait(0.0)
    state.resume()
    assert state.budget is None
    state.spend(100)
    assert state.budget is None
    state.pause()
    state.shutdown()
    assert state.wait(0.0)
