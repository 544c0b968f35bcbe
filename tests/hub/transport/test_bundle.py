"""Bundles: the signals of a participant for a device, in one message."""

from contextlib import contextmanager
from itertools import pairwise
from types import SimpleNamespace
from unittest.mock import patch

import pytest
from hypothesis import given
from hypothesis import strategies as st
from zenoh.handlers import FifoChannel

from hub.transport.bundle import (
    Bundle,
    DeviceBundle,
    ObserverBundle,
    bundled_connections,
    unpack_bundle,
    use_mask,
)
from hub.transport.envelope import Tag
from hub.transport.refusals import Refusals
from hub.transport.zenoh_session import open_session
from schemas.errors import MessageError
from tests.hub.authorities import free_endpoint
from tests.hub.parts import Part, Stylus, into, out, plan_of
from tests.waiting import until


@pytest.fixture(scope="module")
def bundle():
    with open_session("router", listen=[free_endpoint()]) as session:
        made = Bundle(session, "trocar/test/engine/arm/signals/console", lambda: None)
        made.received = session.declare_subscriber("trocar/test/engine/arm/signals/console", FifoChannel(100))
        until(lambda: made.takes(0, 1))
        yield made
        made.close()


@given(values=st.lists(st.tuples(st.integers(0, 200), st.binary(max_size=300)), min_size=1, max_size=20))
def test_a_bundle_unpacks_to_the_values_that_were_added(bundle, values):
    for index, payload in values:
        bundle.add(index, payload)
    bundle.send(b"tag")
    sample = bundle.received.recv()
    assert sample.attachment.to_bytes() == b"tag"
    assert list(unpack_bundle(sample.payload.to_bytes())) == values


def test_it_is_filled_by_values_and_emptied_by_sending(bundle):
    assert not bundle.filled
    bundle.add(0, b"something")
    assert bundle.filled
    bundle.send(b"first")
    assert not bundle.filled
    assert bundle.received.recv().attachment.to_bytes() == b"first"


@pytest.mark.parametrize(("cut", "where"), [(4, "within a head"), (10, "within a value of 5")])
def test_invalid_bytes_are_refused(bundle, cut, where):
    bundle.add(7, b"12345")
    bundle.send(b"")
    payload = bundle.received.recv().payload.to_bytes()
    with pytest.raises(MessageError, match=where):
        list(unpack_bundle(payload[:cut]))


def test_both_ends_number_the_same_connections():
    arm = Part("arm", out("a"), out("b"), out("e", variability="event"))
    console = Stylus("console", into("x"), into("y"), into("z", variability="event"))
    plan = plan_of(
        arm, console, connections=["arm.b -> console.x", "arm.e -> console.z", "arm.a -> console.y"]
    )
    assert [(k.source_port, k.target_port) for k in bundled_connections(plan, "arm", "console")] == [
        ("b", "x"),
        ("a", "y"),
    ]
    assert bundled_connections(plan, "arm", "other") == []


KEY = "trocar/test/engine/arm/signals/camera"


def subscribed(session, bundle):
    """Return a subscriber of `bundle` that it knows of."""
    subscriber = session.declare_subscriber(KEY, FifoChannel(100))
    until(lambda: bundle.takes(0, 1))
    return subscriber


def test_an_observer_gets_the_values_that_hold_at_its_period_and_the_first_again_when_it_joins_again():
    with open_session("router", listen=[free_endpoint()]) as session:
        bundle = ObserverBundle(session, KEY, lambda: None, 40)
        assert not bundle.takes(0, 2)
        camera = subscribed(session, bundle)
        assert [t for t in range(0, 121, 2) if bundle.takes(t, 2)] == [0, 40, 80, 120]
        assert [t for t in range(0, 181, 30) if bundle.takes(t, 30)] == [0, 30, 60, 120, 150, 180]
        assert all(bundle.takes(t, 48) for t in range(0, 480, 48))

        def send(payload, *, first=False):
            bundle.add(0, payload)
            bundle.send(payload, first=first)

        send(b"surface", first=True)
        send(b"40")
        assert [camera.recv().attachment.to_bytes() for _ in "12"] == [b"surface", b"40"]
        camera.undeclare()
        until(lambda: not bundle.takes(0, 1))
        camera = subscribed(session, bundle)
        send(b"80")
        send(b"120")
        assert [camera.recv().attachment.to_bytes() for _ in "123"] == [b"surface", b"80", b"120"]
        bundle.close()


USES = "trocar/test/device/camera/uses/arm"


@contextmanager
def device_bundle(use_ns=0, count=3):
    """Yield a bundle for a device that subscribes, the session, its refusals, and the calls of `changed`."""
    refusals, changes = Refusals(), []
    with open_session("router", listen=[free_endpoint()]) as session:
        bundle = DeviceBundle(
            session,
            KEY,
            lambda: changes.append(1),
            use_ns=use_ns,
            uses_key=USES,
            count=count,
            run=7,
            refusals=refusals,
        )
        device = subscribed(session, bundle)
        yield bundle, session, refusals, changes
        device.undeclare()
        bundle.close()


@given(use=st.integers(0, 50), stride=st.integers(1, 60))
def test_a_device_gets_a_new_value_for_each_use_and_no_more_than_it_needs_for_that(use, stride):
    with patch.object(DeviceBundle, "__init__", lambda *_: None):
        bundle = DeviceBundle()
    bundle._use_ns, bundle._publisher = use, SimpleNamespace(needed=True)
    times = range(0, 40 * stride, stride)
    taken = [time_ns for time_ns in times if bundle.takes(time_ns, stride)]
    gaps = {after - before for before, after in pairwise(taken)}
    if use < 2 * stride:
        assert taken == list(times)
    else:
        (gap,) = gaps
        assert use - stride < gap <= use


def test_a_device_says_what_it_needs():
    with device_bundle() as (bundle, session, refusals, changes):
        assert [bundle.needs(index) for index in range(3)] == [True] * 3
        before = len(changes)
        for run, told in ((7, use_mask(["a", "b", "c"], {"b"})), (7, b"\1"), (8, b"\0\0\0")):
            session.put(USES, told, attachment=Tag.pack(run, 0, -1, 0))
        until(lambda: refusals.total >= 2 and len(changes) > before)
        assert [bundle.needs(index) for index in range(3)] == [True, False, True]
        assert (refusals.total, len(changes)) == (2, before + 1)
