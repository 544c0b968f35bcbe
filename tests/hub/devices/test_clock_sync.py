"""The thread that measures the hub's clock ends before its Zenoh session is closed."""

import signal
import threading

import pytest

from hub.devices.clock_sync import ClockSync
from schemas.keys import Keys
from tests.waiting import LIMIT_S


class SlowHub:
    """A session in which nobody answers a query until `answering` is set."""

    def __init__(self):
        self.asked, self.answering, self.answered = (threading.Event() for _ in range(3))

    def get(self, *_arguments, **_options):
        self.asked.set()
        assert self.answering.wait(LIMIT_S)
        self.answered.set()
        return ()


def test_ctrl_c_while_a_query_is_under_way_waits_for_the_end_of_the_query():
    hub = SlowHub()
    clock = ClockSync(hub, Keys("session"))

    def press() -> None:
        while not clock._ending.is_set():
            threading.Event().wait(0.01)
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)
        threading.Event().wait(0.1)
        hub.answering.set()

    presser = threading.Thread(target=press, daemon=True)
    clock.__enter__()
    assert hub.asked.wait(LIMIT_S)
    presser.start()
    with pytest.raises(KeyboardInterrupt):
        clock.__exit__(None, None, None)
    assert hub.answered.is_set()
