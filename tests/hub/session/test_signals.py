"""Ctrl-C, SIGTERM and SIGKILL, sent to `trocar run` as a user or an operating system would."""

import importlib
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from time import sleep

import pytest

from hub.hosting.interrupt import Interrupt
from hub.recording.recording import Recording
from hub.recording.recover import recover
from tests.hub.authorities import free_endpoint
from tests.hub.processes import hosts, processes
from tests.waiting import LIMIT_S, until

ENDLESS = """\
name: endless
step: 1 ms
participants:
  here: {kind: "toys:Paced"}
  there: {kind: "toys:Paced", host: other}
connections:
  - here.out -> there.a
order: [here, there]
"""
FAILING = """\
name: failing
step: 1 ms
participants:
  here: {kind: "toys:Fault", host: other, how: raise}
"""


class Hub:
    """`trocar run` in a process of its own."""

    def __init__(self, directory: Path, text: str, **options):
        (directory / "session.yaml").write_text(text)
        self.endpoint = free_endpoint()
        self.recording = directory / "recording"
        run = ["run", "session.yaml", "--listen", self.endpoint, "--record", "recording"]
        self.errors = (directory / "stderr").open("w+")
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "hub.command_line", *run],
            cwd=directory,
            stderr=self.errors,
            **options,
        )

    @property
    def recorded(self):
        """Bytes of recording."""
        return sum(file.stat().st_size for file in self.recording.glob("*.mcap"))

    def wait_until_it_records(self):
        until(lambda: self.recorded > 50_000)

    def end(self):
        """Wait for the end; return exit code and stderr."""
        try:
            code = self.process.wait(LIMIT_S)
        finally:
            self.process.kill()
            self.process.wait()
        self.errors.seek(0)
        return code, self.errors.read()


@pytest.fixture
def hub(toys, tmp_path):
    hubs = []

    def start(text, **options):
        hubs.append(Hub(tmp_path, text, **options))
        return hubs[-1]

    yield start
    for hub in hubs:
        hub.process.kill()
        hub.process.wait()
        hub.errors.close()


def _ignore_interrupts():
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_closes_its_recording_and_processes(hub, number):
    run = hub(ENDLESS)
    run.wait_until_it_records()
    os.kill(run.process.pid, number)
    code, errors = run.end()
    assert code == 1
    assert "interrupted at step" in errors
    assert "Traceback" not in errors
    assert processes(run.endpoint) == []
    recording = Recording(run.recording)
    assert [status.state for _, status in recording.statuses()][-1] == "failed"
    assert len(list(recording.grants())) > 50


def test_a_run_in_the_background_of_a_script_ends_by_sigterm(hub):
    """A shell lets such processes ignore SIGINT, and so do their children."""
    run = hub(ENDLESS, preexec_fn=_ignore_interrupts)
    run.wait_until_it_records()
    os.kill(run.process.pid, signal.SIGTERM)
    code, errors = run.end()
    assert (code, processes(run.endpoint)) == (1, [])
    assert "killing it" not in errors


def test_a_host_that_is_stopped_for_seconds_is_waited_for(hub):
    run = hub(ENDLESS)
    run.wait_until_it_records()
    (host,) = hosts(run.endpoint)
    os.kill(host, signal.SIGSTOP)
    sleep(2.0)
    recorded = run.recorded
    os.kill(host, signal.SIGCONT)
    until(lambda: run.recorded > recorded + 50_000)
    os.kill(run.process.pid, signal.SIGINT)
    assert "interrupted at step" in run.end()[1]


def test_the_hosts_of_a_killed_hub_end_by_themselves_and_its_recording_is_recovered(hub, tmp_path):
    run = hub(ENDLESS)
    run.wait_until_it_records()
    assert len(processes(run.endpoint)) == 2
    run.process.kill()
    assert run.end()[0] == -signal.SIGKILL
    until(lambda: not processes(run.endpoint))
    recover(run.recording, tmp_path / "recovered")
    grants = [grant.step for grant in Recording(tmp_path / "recovered").grants()]
    assert grants == list(range(len(grants)))
    assert len(grants) > 50


def test_a_failed_session_is_exit_code_1(hub):
    code, errors = hub(FAILING).end()
    assert code == 1, errors
    assert "participant 'here' failed at step 5: ArithmeticError: the rope is torn" in errors


def test_an_interrupt_that_is_lost_in_a_callback_is_raised_again():
    with Interrupt() as interrupt:
        with suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGTERM)
            sleep(10.0)
        with pytest.raises(KeyboardInterrupt):
            interrupt.check()
        interrupt.disarm()
        interrupt.check()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_waits_for_the_end_of_an_import(tmp_path, monkeypatch, number):
    """A module in C++ ends the process instead of raising."""
    (tmp_path / f"half_imported_{int(number)}.py").write_text(
        f"import os, time\nos.kill(os.getpid(), {int(number)})\ntime.sleep(0.3)\ndone = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with Interrupt():
        module = importlib.import_module(f"half_imported_{int(number)}")
        with pytest.raises(KeyboardInterrupt):
            sleep(10.0)
    assert module.done


def test_a_session_that_runs_while_its_script_is_imported_is_interrupted(tmp_path, monkeypatch):
    (tmp_path / "script_with_session.py").write_text(
        "import os, signal, time\nfrom hub.hosting.interrupt import Interrupt\n"
        "with Interrupt():\n    os.kill(os.getpid(), signal.SIGTERM)\n    time.sleep(10.0)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        importlib.import_module("script_with_session")


def test_an_interrupt_that_ctypes_has_turned_into_an_error_is_an_interrupt(hub):
    code, errors = hub(FAILING.replace("host: other, how: raise", "how: interrupt")).end()
    assert code == 1, errors
    assert "error: interrupted at step" in errors
