import os
from contextlib import contextmanager

import pytest
import zenoh
from zenoh.handlers import Callback

from hub.transport import control_client
from hub.transport.control_client import join_session
from hub.transport.control_messages import JoinReply, JoinRequest, Refusal
from hub.transport.zenoh_session import open_session
from schemas.codec import encode
from schemas.errors import ConnectError, MessageError
from schemas.keys import Keys
from schemas.ros import StringMessage
from tests.hub.authorities import free_endpoint
from tests.hub.parts import Part, out, plan_of

KEYS = Keys("lab")
REPLY = JoinReply(
    session="lab",
    run=1,
    admission=1,
    plan=plan_of(Part("source", out()), specs={"source": {"host": "cameras"}}),
    params={},
    directory="/",
    watched=[],
    ack_key="",
    programs_endpoint="",
    profile=False,
    renewals=[],
    live_from_ns=0,
)


@contextmanager
def hub(*answers):
    """A hub that answers the requests of hosts in turn; None: not in time."""
    left, late = list(answers), list[zenoh.Query]()

    def answer(query):
        reply = left.pop(0)
        if reply is None:
            late.append(query)  # a query that is kept is not finished
            return
        with query:
            query.reply(str(query.key_expr), encode(StringMessage(data=reply.model_dump_json())))

    with open_session("router", listen=[free_endpoint()], alone=True) as session:
        queryable = session.declare_queryable(KEYS.join("**"), Callback(answer, indirect=False))
        yield session
        queryable.undeclare()


@pytest.fixture(autouse=True)
def short_waits(monkeypatch):
    monkeypatch.setattr(control_client, "_ANSWER_S", 0.2)
    monkeypatch.setattr(control_client, "_STARTING_S", 0.0)


def request(host):
    return JoinRequest(host=host, pid=os.getpid())


def test_a_host_that_the_hub_has_started_asks_until_the_hub_answers():
    with hub(None, None, REPLY) as session:
        assert join_session(session, KEYS, request("cameras")) == REPLY


def test_a_host_elsewhere_gives_up():
    with hub(None) as session, pytest.raises(ConnectError, match=r"no answer on .*remote/arm"):
        join_session(session, KEYS, request("remote/arm"))


def test_a_refusal_is_an_answer():
    with hub(None, Refusal(refused="no such host")) as session, pytest.raises(MessageError, match="no such"):
        join_session(session, KEYS, request("cameras"))
