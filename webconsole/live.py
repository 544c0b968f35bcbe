"""A running session as the source of pages: the newest values, received without a wait of the session.

A thread connects to the hub, and after the hub's end again, or to another hub. Only the outlets shown on a
page are subscribed to; values stay as bytes until needed for a frame.
"""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any, TypeVar

import zenoh
from pydantic import BaseModel
from zenoh.handlers import Callback

from hub.devices.network_link import describe_link
from hub.devices.network_link_control import NetworkLinkReply, NetworkLinkRequest
from hub.participant import Params
from hub.planning.plan import Plan
from hub.planning.session_parameters import SessionParameters
from hub.remote.hub_connection import reach
from hub.remote.live_sessions import live_sessions
from hub.security.credentials import OBSERVER
from hub.transport.cells import INITIAL
from hub.transport.control_client import ask
from hub.transport.control_messages import DescribeReply, Empty
from hub.transport.endpoints import is_loopback
from hub.transport.envelope import Tag
from hub.transport.hub_files import running_hubs
from schemas.codec import decode
from schemas.errors import ConnectError, MessageError, ScenarioError
from schemas.files import Files
from schemas.keys import Keys, topic
from schemas.network_link import NetworkLinkSpec
from schemas.readable import counted
from schemas.scenario import Scenario
from schemas.trocar_msgs import ScoreCard, SessionStatus
from webconsole.commands import Tune
from webconsole.gauges import HUB, hub_outlets
from webconsole.guide import guided_participant
from webconsole.log import Entries, Entry, Tally, is_logged
from webconsole.past import Past
from webconsole.source import Outlet, Value
from webconsole.tunables import TunableParameters

__all__ = ["Live"]

log = logging.getLogger(__name__)

_RETRY_S = 0.5
_ENTRIES_KEPT = 500
R = TypeVar("R", bound=BaseModel)


class Live:
    """The source of the pages of a running session.

    Args:
        endpoint: Endpoint of the hub; None: any hub of this user on this machine.
        session: Name of the session; None: the first session found.
        pid: The process of the hub; None: any.
    """

    kind = "live"

    def __init__(
        self, endpoint: str | None = None, session: str | None = None, pid: int | None = None
    ) -> None:
        self._endpoint, self._session_wanted, self._pid = endpoint, session, pid
        self.generation = 0
        self.scenario: Scenario | None = None
        self.guided: str | None = None
        self.outlets: Sequence[Outlet] = ()
        self.recording = ""
        self.past: Past | None = None
        """None if the session is not recorded on this machine."""
        self._links: dict[str, NetworkLinkSpec] = {}
        self._tunables = TunableParameters()
        self._entries: deque[tuple[int, Entry]] = deque(maxlen=_ENTRIES_KEPT)
        self._numbered = 0
        self._lines = Entries()
        self.plan: Plan | None = None
        self.endpoint = ""
        """Where the hub of the session listens."""
        self.left_out: Callable[[], set[int]] = set
        """Returns the processes of hubs with separate pages."""
        self.keep: Callable[[str, Value], None] = lambda _name, _value: None
        """Called with each value received and its outlet, in a thread of the connection."""
        self._status: SessionStatus | None = None
        self._trouble = "looking for a session"
        self._values: dict[str, Value] = {}
        self._firsts: dict[str, Value] = {}
        self._by_name: dict[str, Outlet] = {}
        self._wanted: frozenset[str] = frozenset()
        self._run = 0
        self._late, self._refused = Tally(), Tally()
        self._device_keys: set[str] = set()
        self._untagged: set[str] = set()
        """Participants with messages without a simulated time."""
        self._session: zenoh.Session | None = None
        self._keys = Keys("none")
        self._subscribers: dict[str, zenoh.Subscriber[None]] = {}
        self._lock = threading.RLock()
        self._gone, self._ending = threading.Event(), threading.Event()
        self.is_over = False
        """Whether the hub of a session shown has ended."""
        self._thread = threading.Thread(target=self._serve, name="live", daemon=True)

    def start(self) -> None:
        """Begin to look for the session."""
        self._thread.start()

    @property
    def state(self) -> Mapping[str, Any]:
        """Name and state of the session, simulated time (s), factor of real time, counts and latencies."""
        status = self._status
        if self._session is None or status is None:
            ended = {} if status is None else {"session": status.session, "time": status.sim_time_ns / 1e9}
            return {"state": "away", "detail": self._trouble, **ended, **self._span()}
        return {
            "session": status.session,
            "state": status.state,
            "time": status.sim_time_ns / 1e9,
            "step": status.step,
            "factor": status.real_time_factor,
            "late": status.late_steps,
            "dropped": status.dropped_messages,
            "detail": status.detail,
            "recording": self.recording,
            **self._span(),
            "latencies": [
                {"way": one.way, "stream": one.stream, "p50": one.p50_s, "p99": one.p99_s}
                for one in status.latencies
            ],
            "links": [
                {
                    "device": name,
                    "delay": link.delay_ns / 1e9,
                    "jitter": link.jitter / 1e9,
                    "loss": link.loss,
                    "text": describe_link(link),
                }
                for name, link in self._links.items()
            ],
            "tunables": self._tunables.as_json(),
        }

    def _span(self) -> dict[str, float]:
        """Return the first and last simulated time (s) of the past."""
        span_ns = None if self.past is None else self.past.span_ns
        return {} if span_ns is None else {"start": span_ns[0] / 1e9, "end": span_ns[1] / 1e9}

    def want(self, names: frozenset[str]) -> None:
        """Subscribe to these outlets, and to no others."""
        with self._lock:
            self._wanted = names
            self._subscribe_keys()

    def newest(self, name: str, time_ns: int | None) -> Value | None:
        """Return the newest value received; at a simulated time, the recorded value."""
        if time_ns is None:
            return self._values.get(name)
        outlet = self._by_name.get(name)
        if self.past is None or outlet is None:
            return None
        return self.past.newest(topic(self._output_key(outlet)), time_ns)

    def first(self, name: str) -> Value | None:
        """Return the value at time 0 of a surface, sent to each new subscriber."""
        return self._firsts.get(name)

    def ask(self, verb: str, request: BaseModel, model: type[R]) -> R:
        """Send a control request to the hub; raises ConnectError or MessageError."""
        session = self._session
        if session is None:
            raise ConnectError("no session is running")
        return ask(session, self._keys.control(verb), request, model)

    def change_link(self, request: NetworkLinkRequest) -> None:
        """Change the network link of a device; raises ConnectError or MessageError."""
        reply = self.ask("link", request, NetworkLinkReply)
        self._links[reply.device] = reply.link
        status = self._status
        at = 0.0 if status is None else status.sim_time_ns / 1e9
        self._note_entry(Entry(at, "info", reply.device, f"network link: {reply.description or 'none'}"))

    def tune(self, order: Tune) -> None:
        """Change a parameter of the running session; raises ConnectError or MessageError."""
        request = self._tunables.request(order)
        self.ask("set", request, Empty)
        status = self._status
        at = 0.0 if status is None else status.sim_time_ns / 1e9
        self._note_entry(Entry(at, "info", request.participant, self._tunables.change_value(order)))

    def entries_after(self, number: int) -> tuple[int, list[Entry]]:
        """Return the lines of the log after the line with this number, and the number of the last."""
        with self._lock:
            return self._numbered, [entry for of_it, entry in self._entries if of_it > number]

    def sessions(self) -> list[dict[str, Any]]:
        """Return the sessions of this user on this machine."""
        return [
            {"session": one.session, "state": one.state, "time": one.sim_time_ns / 1e9}
            for one in live_sessions(self._endpoints())
        ]

    def watch(self, session: str) -> None:
        """Show another session from now on."""
        self._session_wanted = session
        self._gone.set()

    def close(self) -> None:
        """Leave the session."""
        self._ending.set()
        self._gone.set()
        if self._thread.is_alive():
            self._thread.join(timeout=3.0)

    def _serve(self) -> None:
        while not self._ending.is_set():
            self._gone.clear()
            try:
                self._look()
            except (ConnectError, MessageError, zenoh.ZError) as error:
                self._trouble = str(error)
            self._ending.wait(_RETRY_S)
            self._look_back()

    def _look_back(self) -> None:
        if self.past is not None:
            self.past.look()

    def _look(self) -> None:
        """Show a session until its end; raises ConnectError without a session."""
        endpoint, name = self._find_session()
        with reach(endpoint, OBSERVER) as session:
            keys = Keys(name)
            described = ask(session, keys.control("describe"), Empty(), DescribeReply)
            with self._lock:
                self.endpoint, self.plan = endpoint, described.plan
                self._begin(session, keys, described, here=is_loopback(endpoint))
            status = session.declare_subscriber(keys.status, Callback(self._take_status, indirect=False))
            alive = session.liveliness().declare_subscriber(
                keys.alive("hub", "hub"), Callback(self._take_life, indirect=True), history=True
            )
            try:
                while not self._gone.wait(1.0):
                    self._ask_status(session, keys)
                    self._look_back()
            finally:
                with self._lock:
                    self._session = None
                    self._trouble = f"session '{name}' is over, or its hub is gone"
                    self._drop()
                alive.undeclare()
                status.undeclare()

    def params(self, participant: str) -> Params:
        """Return the validated parameters of a participant. Raises ScenarioError if invalid here."""
        if self.scenario is None:
            raise ScenarioError("there is no session")
        return SessionParameters.of_scenario(self.scenario, Files(Path.cwd())).validate_last(participant)

    def _find_session(self) -> tuple[str, str]:
        for endpoint in self._endpoints():
            for status in live_sessions([endpoint]):
                if self._session_wanted in (None, status.session):
                    return endpoint, status.session
        named = f"session '{self._session_wanted}'" if self._session_wanted else "session"
        raise ConnectError(f"no {named} is running on this machine")

    def _endpoints(self) -> list[str]:
        if self._endpoint is not None:
            return [self._endpoint]
        left_out = self.left_out()
        return [
            hub.endpoint for hub in running_hubs() if self._pid in (None, hub.pid) and hub.pid not in left_out
        ]

    def _begin(self, session: zenoh.Session, keys: Keys, described: DescribeReply, *, here: bool) -> None:
        self._values, self._firsts = {}, {}
        self._status, self._lines = None, Entries()
        self._late, self._refused = Tally(), Tally()
        self._run, self._keys = described.run, keys
        self.scenario, self.recording = described.scenario, described.recording
        self.past = Past(Path(described.recording)) if described.recording and here else None
        self.outlets = (
            *(
                Outlet(planned.name, port, live=planned.role != "device" or not planned.simulated_time)
                for planned in described.plan.participants.values()
                for port in planned.ports
                if port.causality == "output"
            ),
            *hub_outlets(described.scenario),
        )
        self.guided = guided_participant(described.plan)
        self._by_name = {one.name: one for one in self.outlets}
        self._device_keys = {
            planned.name for planned in described.plan.participants.values() if planned.role == "device"
        }
        self._untagged = self._device_keys | {HUB}
        self._links = {
            name: described.plan.participants[name].network_link or NetworkLinkSpec()
            for name in sorted(self._device_keys)
        }
        self._tunables = TunableParameters(described.plan, described.tuned)
        self._session = session
        self._trouble = f"session '{described.session}' gives no status yet"
        self.generation += 1
        self._note_entry(Entry(0.0, "info", "session", f"'{described.session}' is shown"))
        self._subscribe_keys()

    def _subscribe_keys(self) -> None:
        session = self._session
        if session is None:
            return
        logged = {
            one.name for one in self.outlets if is_logged(one.port) or one.port.type == ScoreCard.ros_type
        }
        names = {name for name in self._wanted | logged if name in self._by_name and self._by_name[name].live}
        for name in self._subscribers.keys() - names:
            self._subscribers.pop(name).undeclare()
        for name in names - self._subscribers.keys():
            outlet = self._by_name[name]
            key = (
                self._output_key(outlet)
                if outlet.participant in self._untagged
                else self._keys.view(outlet.participant, outlet.port.name)
            )
            take = Callback(partial(self._store, outlet), indirect=False)
            self._subscribers[name] = session.declare_subscriber(key, take)

    def _output_key(self, outlet: Outlet) -> str:
        if outlet.participant == HUB:
            return f"{self._keys.prefix}/{HUB}/{outlet.port.name}"
        role = "device" if outlet.participant in self._device_keys else "engine"
        return self._keys.output(role, outlet.participant, outlet.port.name)

    def _drop(self) -> None:
        for subscriber in self._subscribers.values():
            subscriber.undeclare()
        self._subscribers = {}

    def _store(self, outlet: Outlet, sample: zenoh.Sample) -> None:
        """Keep a value, to be decoded when needed for a frame."""
        payload = sample.payload.to_bytes()
        if outlet.participant in self._untagged:
            status = self._status
            value = Value(0 if status is None else status.sim_time_ns, payload)
        else:
            try:
                tag = Tag.of(sample)
            except MessageError:
                return
            if tag.run != self._run:
                return
            value = Value(tag.time_ns, payload)
            if tag.step == INITIAL:
                self._firsts[outlet.name] = value
                if outlet.name in self._values:
                    return
        self._values[outlet.name] = value
        self.keep(outlet.name, value)
        if is_logged(outlet.port):
            try:
                for entry in self._lines.lines_of(outlet, value):
                    self._note_entry(entry)
            except MessageError as error:
                self._note_entry(Entry(value.time_ns / 1e9, "warn", outlet.name, f"not shown: {error}"))

    def _take_status(self, sample: zenoh.Sample) -> None:
        try:
            status = decode(SessionStatus, sample.payload.to_bytes())
        except MessageError as error:
            self._note_entry(Entry(0.0, "warn", "session", f"a status is not shown: {error}"))
            return
        before, self._status = self._status, status
        at = status.sim_time_ns / 1e9
        if before is None:
            return
        if status.state != before.state:
            failed = status.state == "failed"
            self._note_entry(Entry(at, "error" if failed else "info", "session", status.state))
        if status.detail != before.detail and status.detail:
            self._note_entry(Entry(at, "warn", "session", status.detail))
        if late := self._late.more(status.late_steps, monotonic()):
            self._note_entry(Entry(at, "warn", "session", counted(late, "late step")))
        if refused := self._refused.more(status.dropped_messages, monotonic()):
            self._note_entry(Entry(at, "warn", "session", f"{counted(refused, 'message')} refused"))

    def _ask_status(self, session: zenoh.Session, keys: Keys) -> None:
        """Ask for the status: a paused session publishes none."""
        for reply in session.get(keys.status, timeout=1.0):
            if reply.ok is not None:
                self._take_status(reply.ok)

    def _take_life(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.DELETE:
            self.is_over = True
            self._gone.set()

    def _note_entry(self, entry: Entry) -> None:
        with self._lock:
            self._numbered += 1
            self._entries.append((self._numbered, entry))
