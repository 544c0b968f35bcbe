"""The link between the hub and a host that it has started."""

import os
import socket
import sys
import threading

import numpy as np
import pytest

from hub.transport.host_link import IDLE, HostLink, HubLink, has_link
from schemas.lockstep import Ack, Grant, pack_ack, pack_grant, unpack_grant
from schemas.trocar_msgs import InletSample

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="hosts have links on Linux alone")
NAMES = ["robot", "tissue", "camera"]


@pytest.fixture
def ends():
    """Return both ends of a link, as the hub and the host's process have them."""
    hub = HubLink(NAMES)
    host = HostLink(*map(os.dup, hub.inherited))
    hub.close_inherited()
    yield hub, host
    hub.close()
    host.close()


def ack(step):
    return pack_ack(Ack(1, 0, step, (step,), (0,), ()))


def next_grant(host):
    while (grant := host.grant(wait=True)) is None:
        pass
    return grant


def test_hosts_that_the_hub_starts_on_this_machine_have_one():
    assert [has_link(host) for host in ("hub", "one", "remote/far")] == [False, True, False]


def test_the_acks_of_all_participants_are_one_message(ends):
    hub, host = ends
    assert hub.acks(wait=False) == []
    host.send_acks([(0, ack(1)), (2, ack(2))])
    host.send_acks([(1, ack(3))])
    assert hub.acks(wait=True) == [("robot", ack(1)), ("camera", ack(2))]
    assert hub.acks(wait=False) == [("tissue", ack(3))]
    assert hub.acks(wait=True) == []


def test_a_grant_may_be_larger_than_the_buffer_of_a_socket(ends):
    hub, host = ends
    picture = np.arange(5 * 2**20, dtype=np.uint8)
    sample = InletSample(participant="robot", port="picture", payload=picture)
    payload = pack_grant(Grant(1, 0, 7, 7, 8, [sample]))
    received = []
    reader = threading.Thread(target=lambda: received.append(next_grant(host)))
    reader.start()
    hub.send_grant(payload)
    hub.send_grant(pack_grant(Grant(1, 0, 8, 8, 9)))
    reader.join()
    (inlet,) = unpack_grant(received[0]).inlets
    assert np.array_equal(inlet.payload, picture)
    assert unpack_grant(next_grant(host)).step == 8
    assert host.grant(wait=False) is None


def test_the_hub_knows_which_participants_a_host_has_passed(ends):
    hub, host = ends
    assert hub.passed == []
    host.place[0] = 2
    assert hub.passed == ["robot", "tissue"]
    host.place[0] = IDLE
    assert hub.passed == []


def test_what_a_host_has_sent_before_its_end_is_received(ends):
    hub, host = ends
    host.send_acks([(0, ack(4))])
    host.close()
    assert hub.acks(wait=True) == [("robot", ack(4))]
    assert hub.acks(wait=True) == []
    hub.send_grant(b"to no one")


def test_no_other_process_inherits_it_and_it_has_no_name():
    other = HubLink(NAMES)
    assert not any(map(os.get_inheritable, other.inherited))
    own = other.inherited[0]
    with socket.socket(fileno=os.dup(own)) as end:
        assert (end.getsockname(), end.getpeername()) == ("", "")
    other.close()
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.fstat(own)
