"""Values between hosts of this machine arrive whole and in order, and no host waits for ever."""

import sys
import threading
from collections import defaultdict

import pytest

from hub.transport.local_values import Inboxes, LocalValues
from tests.hub.conftest import Prepare

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="hosts have such sockets on Linux alone")

SCENARIO = """\
name: local
step: 1 ms
duration: 40 ms
window: 4
algorithm: jacobi
participants:
  one: {kind: "toys:Mixer", seed: 1}
  two: {kind: "toys:Mixer", seed: 2, host: other}
  three: {kind: "toys:Mixer", seed: 3, host: third}
  talker: {kind: "toys:Talker", host: third}
  far: {kind: "toys:Mixer", host: remote}
  listener: {kind: "toys:Listener", period: 2 ms, host: other}
connections:
  - one.out -> two.a
  - two.out -> one.a
  - three.out -> one.b
  - two.out -> three.a
  - talker.words -> listener.words
  - one.out -> far.a
"""
TAG = bytes(range(40))


@pytest.fixture
def hosts(prepare: Prepare):
    """The values of each host, as its process has them."""
    plan = prepare(SCENARIO).plan
    inboxes = Inboxes(plan)
    yield {host: LocalValues(plan, host, inboxes.ends(host)) for host in ("hub", "other", "third")}
    inboxes.close()


def test_each_reader_has_what_it_reads_and_remote_hosts_have_nothing(hosts) -> None:
    assert hosts["hub"].output("one", "out") is None
    assert hosts["hub"].sender("remote/far", "one", "out") is None
    assert hosts["other"].output("one", "out") is not None
    hosts["hub"].sender("other", "one", "out").put(b"value", TAG)
    output = hosts["other"].output("one", "out")
    assert output.receive(wait=True) is None
    hosts["hub"].flush()
    assert output.receive(wait=True) == TAG + b"value"
    assert output.receive(wait=False) is None


def test_values_of_two_senders_do_not_mix_and_may_be_larger_than_the_buffer_of_a_socket(hosts) -> None:
    large = {"two": bytes(range(256)) * 2**14, "three": bytes(range(255, -1, -1)) * 2**14}
    senders = {"two": hosts["other"], "three": hosts["third"]}

    def send(name: str) -> None:
        for count in range(3):
            senders[name].sender("hub", name, "out").put(large[name] + bytes([count]), TAG)
            senders[name].flush()

    threads = [threading.Thread(target=send, args=(name,)) for name in large]
    for thread in threads:
        thread.start()
    received = defaultdict(list)
    while sum(map(len, received.values())) < 6:
        for name in large:
            if (value := hosts["hub"].output(name, "out").receive(wait=True)) is not None:
                received[name].append(value)
    for thread in threads:
        thread.join()
    assert received == {name: [TAG + large[name] + bytes([i]) for i in range(3)] for name in large}


def test_two_hosts_that_send_more_than_fits_wait_for_each_other_and_not_for_ever(hosts) -> None:
    def send(host: str, name: str, reader: str, other: str) -> None:
        for _ in range(2000):
            hosts[host].sender(reader, name, "out").put(b"value", TAG)
            hosts[host].flush()
        while len(hosts[host].output(other, "out").arrived) < 2000:
            hosts[host].wait()

    both = ("hub", "one", "other", "two"), ("other", "two", "hub", "one")
    threads = [threading.Thread(target=send, args=arguments) for arguments in both]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


SELDOM = """\
name: seldom
step: 1 ms
duration: 1200 ms
window: 600
participants:
  one: {kind: "toys:Mixer", seed: 1, period: 600 ms, step_ns: 600000000, host: READER}
  two: {kind: "toys:Mixer", seed: 2, host: other}
  three: {kind: "toys:Mixer", seed: 3, host: other}
connections:
  - two.out -> one.a
  - three.out -> one.b
"""


@pytest.mark.long
@pytest.mark.parametrize("reader", ["hub", "third"])
def test_a_reader_that_seldom_steps_makes_room(prepare: Prepare, reader: str) -> None:
    apart = prepare(SELDOM.replace("READER", reader)).run()
    assert apart.state_hash == prepare(SELDOM.replace("READER", reader), one_host=True).run().state_hash


def test_the_sockets_have_no_name_and_no_other_process_inherits_them(prepare: Prepare) -> None:
    inboxes = Inboxes(prepare(SCENARIO).plan)
    for end in inboxes.ends("other").values():
        assert (end.getsockname(), end.getpeername(), end.get_inheritable()) == ("", "", False)
    inboxes.close()
    assert all(end.fileno() == -1 for end in inboxes.ends("hub").values())


@pytest.mark.long
def test_hosts_of_a_machine_publish_nothing_for_each_other_on_zenoh(prepare: Prepare, monkeypatch) -> None:
    keys = []
    monkeypatch.setattr("hub.transport.publisher.Publisher.put", lambda self, *_: keys.append(self))
    text = "".join(line for line in SCENARIO.splitlines(keepends=True) if "far" not in line)
    apart = prepare(text).run()
    assert apart.state_hash == prepare(text, one_host=True).run().state_hash
    assert keys == []
