"""The end of a process that has used Zenoh."""

import subprocess
import sys

SLOW_CALLBACK = """
import threading, time
from hub.transport.zenoh_session import open_session

called = threading.Event()

def take(_sample):
    called.set()
    for _ in range(3000):
        time.sleep(0.0001)

def use():
    with open_session("peer") as session:
        session.declare_subscriber("a", take)
        session.put("a", b"")
        called.wait()

thread = threading.Thread(target=use, daemon=True)  # so Python does not wait for the threads that it starts
thread.start()
thread.join()
"""


def test_a_callback_that_still_runs_does_not_abort_the_process():
    done = subprocess.run([sys.executable, "-c", SLOW_CALLBACK], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
