import sys
import threading
from time import thread_time_ns

import pytest

from hub.observation.thread_clocks import CoreQueue, ThreadClocks

linux = pytest.mark.skipif(sys.platform != "linux", reason="the clocks of threads are Linux' own")

BURN_NS = 60_000_000


def burn():
    until = thread_time_ns() + BURN_NS
    while thread_time_ns() < until:
        pass


@linux
def test_the_time_of_a_thread_is_its_takers_also_when_it_has_ended():
    clocks = ThreadClocks(lambda name: name, "native")
    release, done = threading.Event(), threading.Event()

    def run():
        burn()
        done.set()
        release.wait()

    clocks.restart()
    thread = threading.Thread(target=run, name="burner")
    thread.start()
    done.wait()
    before = clocks.other_ns(clocks.main_ns())["burner"]
    release.set()
    thread.join()
    after = clocks.other_ns(clocks.main_ns())["burner"]
    assert 0.5 * BURN_NS < before <= after


@linux
def test_the_main_thread_is_not_among_the_others():
    clocks = ThreadClocks(lambda name: name, "native")
    clocks.restart()
    burn()
    main_ns = clocks.main_ns()
    assert main_ns > 0.5 * BURN_NS
    assert clocks.other_ns(main_ns).get("MainThread") is None


@linux
def test_the_time_without_a_core_only_grows():
    queue = CoreQueue()
    first = queue.waited_ns()
    burn()
    assert queue.waited_ns() >= first >= 0
    queue.close()
    assert queue.waited_ns() == 0
