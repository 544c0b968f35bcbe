"""The start of a run: host processes, joining, configuring, and a first value over every connection."""

from __future__ import annotations

import logging
from time import sleep

from hub.hosting.patience import Patience
from hub.planning.bonds import check_bonds
from hub.planning.plan import Plan
from hub.session.run import Run
from schemas.errors import SessionError

__all__ = ["start"]

log = logging.getLogger(__name__)


def start(run: Run) -> None:
    """Start the hosts, and wait until all participants are configured and every connection works.

    Raises SessionError if a host does not join in time, ScenarioError if a bond's step is unstable, and
    ParticipantError.
    """
    spec = run.spec
    hosts = [host for host in spec.plan.hosts() if host != "hub"]
    for host in hosts:
        if not host.startswith("remote/"):
            run.processes.start(host, spec.endpoint, spec.scenario.name)
    bonds = run.host.configure(spec.directory)
    run.devices.open(spec.directory)
    _wait_for_hosts(run, hosts)
    check_bonds(spec.plan, {**bonds, **run.joined_hosts.bonds()})
    _wait_for_connections(run)


def _wait_for_hosts(run: Run, hosts: list[str]) -> None:
    patience = Patience(run.spec.scenario.join_limit)
    gate = run.spec.gate
    endpoints = ", ".join((run.spec.endpoint, *(gate.endpoints if gate is not None else ())))
    logged: list[str] = []
    while missing := run.joined_hosts.missing(hosts):
        run.failure.check()
        if run.state.ending:
            raise SessionError(f"shut down while waiting for {', '.join(missing)} to join")
        if missing != logged:
            log.info("waiting for %s to join at %s", ", ".join(missing), endpoints)
        logged = missing
        if patience.is_over(run.processes.numbers):
            limit_s = patience.limit_ns / 1e9
            named = ", ".join(_with_participants(host, run.spec.plan) for host in missing)
            raise SessionError(f"{named} did not join within {limit_s:g} s (join_limit) at {endpoints}")


def _with_participants(host: str, plan: Plan) -> str:
    names = (f"'{name}'" for name, planned in plan.participants.items() if planned.host == host)
    return f"{host} ({', '.join(names)})"


def _wait_for_connections(run: Run) -> None:
    """Repeat the values at time 0 until every host has received the values to be read there.

    A camera has then drawn the first picture; from here on the session never waits for a camera.
    """
    plan = run.spec.plan
    waiting = [name for name in plan.order if plan.participants[name].host != "hub"]
    waiting += [observer.name for observer in plan.observers()]
    run.watchdog.wait_for(waiting)
    while waiting or not run.host.has_initial_values() or not run.monitor.has_start_values():
        run.host.publish_initial()
        run.failure.check()
        for name in run.acks.ready(waiting):
            waiting.remove(name)
        for observer in plan.observers():
            if observer.name in waiting and run.joined_hosts.watching(observer.host):
                waiting.remove(observer.name)
        sleep(0.005)
    run.watchdog.wait_for(())
