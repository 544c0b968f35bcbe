"""Forks: a session that repeats a recording up to an instant, and goes on from there with changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

from hub.hash_comparison import HashComparison
from hub.observation.summary import Progress, Summary
from hub.planning.plan import Plan, PlannedConnection, PlannedParticipant
from hub.planning.renewal import Renewal
from hub.planning.scenario_file import ScenarioFile, validate_source
from hub.planning.scenario_source import Source
from hub.planning.session_parameters import SessionParameters
from hub.recording.fork_origin import ForkOrigin
from hub.recording.recording import Recording
from hub.recording.trust import trusted_parameters
from hub.session.launch import Continuation, in_one_host, launch, plan_of
from hub.session.past import Past
from hub.session.session import Session
from hub.transport.loopback_port import LoopbackPort
from schemas.errors import RecordingError, ScenarioError, SessionError
from schemas.files import Files
from schemas.scenario import ParticipantSpec, Scenario
from schemas.trocar_msgs import GrantMessage, InletSample

__all__ = ["Fork"]

_Key = tuple[str, str]


class Fork:
    """A session that goes on from an instant of a recording.

    All is simulated again from the recorded grants up to the instant, as fast as the machine can, and every
    state hash is compared on the way. Then the devices of the scenario lead, at the scenario's pace.

    Args:
        recording: The parent, which may be a stranger's.
        at_ns: Simulated time; rounded down to a communication point.
        overrides: Changes, `a.b.c=value`: parameters of engines and controllers that can save their state,
            devices, hosts, pace, duration, measures. More tasks and cameras may be added.
        record: The directory of the fork's own recording.
        trust: Allow the demands refused by `trusted_parameters`.
        directory: Where relative paths of the scenario start, by default the recorded directory.
        one_host: Run every participant in this process.
        endpoint: Where the hub listens on loopback.
        outside: Endpoint for other machines to join, by TLS with the certificate in `certificates`.
        certificates: By default this user's directory.

    Raises RecordingError if there is no such instant in the recording, ScenarioError if a change is not
    possible in a running session, and the errors of `trusted_parameters` and `launch`.
    """

    def __init__(
        self,
        recording: Recording,
        at_ns: int,
        overrides: Sequence[str] = (),
        *,
        record: Path | None = None,
        trust: bool = False,
        directory: Path | None = None,
        one_host: bool = False,
        endpoint: str | LoopbackPort | None = None,
        outside: Sequence[str] = (),
        certificates: Path | None = None,
    ) -> None:
        parent = recording.plan()
        directory = directory or recording.directory()
        recorded = recording.scenario()
        names = dict.fromkeys([*parent.participants, *recorded.participants])
        parameters = trusted_parameters(recording, names, directory, trust=trust)
        step = at_ns // parent.step_ns
        past = parameters.at(step)
        before = _with_parameters(recorded, past)
        file = _change_scenario(before, directory, overrides)
        scenario = in_one_host(file.scenario) if one_host else file.scenario
        plan = _fork_plan(parent, plan_of(scenario, file.params)[0])
        if scenario.duration is not None and scenario.duration <= step * plan.step_ns:
            raise ScenarioError(
                f"the session ends at {scenario.duration / 1e9:g} s, before it is forked at"
                f" {step * plan.step_ns / 1e9:g} s: set a longer one with --set duration=..."
            )
        renewals = *past.renewals, *_parameter_renewals(before, scenario, plan, step)
        grants = _Grants(recording, parent, plan, step)
        self.origin = ForkOrigin(
            parent=str(recording.file),
            parent_run=grants.run,
            step=step,
            time_ns=step * plan.step_ns,
            changes=tuple(overrides),
            renewals=renewals,
        )
        self._comparison = HashComparison(recording, plan, until=step)
        self.session: Session = launch(
            file,
            endpoint=endpoint,
            outside=outside,
            certificates=certificates,
            record=record,
            one_host=one_host,
            continuation=Continuation(
                plan,
                Past(
                    iter(grants),
                    SessionParameters.of_scenario(scenario, Files(directory), renewals),
                    step,
                    _new_devices(before, scenario, plan),
                ),
                self.origin,
                self._comparison.compare_ack,
            ),
        )
        self._comparison.stop = self.session.state.shutdown

    def run(self, progress: Callable[[Progress], None] | None = None) -> Summary:
        """Run to the end and return the summary.

        Raises SessionError if the recorded part does not give the recorded state hashes again, and the errors
        of `Session.run`.
        """
        summary = self.session.run(progress)
        if (first := self._comparison.first) is not None:
            raise SessionError(
                f"'{self.origin.parent}' cannot be forked here: participant '{first[1]}' has another state"
                f" hash than the recorded one in step {first[0]} (see `trocar verify`)"
            )
        return summary


def _with_parameters(scenario: Scenario, parameters: SessionParameters) -> Scenario:
    """Return a recorded scenario with these parameters."""
    specs: dict[str, ParticipantSpec] = {}
    for name, spec in scenario.participants.items():
        kept = spec.model_dump(mode="json", include=set(ParticipantSpec.RESERVED))
        specs[name] = ParticipantSpec.model_validate({**parameters.last[name], **kept})
    return scenario.model_copy(update={"participants": specs})


def _change_scenario(before: Scenario, directory: Path, overrides: Sequence[str]) -> ScenarioFile:
    """Return a recorded scenario with changes."""
    tree: dict[str, Any] = before.model_dump(mode="json")
    source = Source(directory / "scenario.json", tree, {}, before.model_dump_json(indent=2))
    return validate_source(source, overrides)


def _fork_plan(parent: Plan, plan: Plan) -> Plan:
    """Return the plan of a fork, with the start values of the parent.

    Raises ScenarioError where the stepped part differs from the recorded plan. Participants that only look,
    such as tasks, may be added: their outputs feed no recorded participant.
    """
    if plan.step_ns != parent.step_ns:
        raise ScenarioError("a fork keeps the communication step of its parent")
    names = [name for name in parent.order if name in plan.order]
    for name in parent.order:
        if name not in plan.participants:
            raise ScenarioError(f"a fork cannot do without participant '{name}': it has a state")
    if [name for name in plan.order if name in names] != names:
        raise ScenarioError(f"a fork keeps the order of its parent: {', '.join(names)}")
    for name in names:
        one, other = parent.participants[name], plan.participants[name]
        if differing := _changed_property(one, other):
            raise ScenarioError(
                f"participant '{name}' would have other {differing}: in a fork it goes on with its state, so"
                " only parameters may change that leave these as they are"
            )
        if parent.connected_inputs(name) != plan.connected_inputs(name) or _feeding(parent, name) != _feeding(
            plan, name
        ):
            raise ScenarioError(
                f"the inputs of participant '{name}' would be connected in another way; in a fork a device"
                " may take the place of another one, nothing else"
            )
    started = {
        name: plan.participants[name].model_copy(update={"ports": parent.participants[name].ports})
        for name in names
    }
    return plan.model_copy(update={"participants": {**plan.participants, **started}})


def _changed_property(one: PlannedParticipant, other: PlannedParticipant) -> str:
    """Return the first changed property of a participant that may not change in a fork."""
    parts = {
        "kind": (one.kind, other.kind),
        "period": (one.period, other.period),
        "ports": tuple([p.model_copy(update={"start": None}) for p in of.ports] for of in (one, other)),
        "bonds (a stiffness or damping on which the coupling depends)": (
            (one.bonds, one.bond_plans),
            (other.bonds, other.bond_plans),
        ),
    }
    return " and ".join(name for name, (then, now) in parts.items() if then != now)


def _feeding(plan: Plan, name: str) -> list[PlannedConnection]:
    return sorted(
        (one for one in plan.connections if one.target == name), key=lambda one: (one.target_port, one.source)
    )


def _parameter_renewals(before: Scenario, scenario: Scenario, plan: Plan, step: int) -> Iterator[Renewal]:
    """Yield the changes at `step`, if any."""
    changed = {
        name: before.participants[name].params
        for name in plan.order
        if name in before.participants
        and before.participants[name].params != scenario.participants[name].params
    }
    if changed:
        yield Renewal(step=step, before=changed)


def _new_devices(before: Scenario, scenario: Scenario, plan: Plan) -> frozenset[str]:
    """Return the devices in a new place: a person's, and replaced devices."""
    return frozenset(
        name
        for name, planned in plan.participants.items()
        if planned.role == "device"
        and not (
            planned.simulated_time and name in before.participants and _same_device(before, scenario, name)
        )
    )


def _same_device(before: Scenario, scenario: Scenario, name: str) -> bool:
    one, other = before.participants[name], scenario.participants[name]
    return one.model_copy(update={"host": ""}) == other.model_copy(update={"host": ""})


class _Grants:
    """The recorded grants before a step, in the form needed by the plan of the fork."""

    def __init__(self, recording: Recording, parent: Plan, plan: Plan, step: int) -> None:
        self._recording, self._step_ns, self._end = recording, plan.step_ns, step
        first, last = next(recording.grants(), None), recording.last_grant()
        last_ns = 0 if last is None else last.horizon_ns
        if first is None or not 0 < step * plan.step_ns <= last_ns:
            raise RecordingError(
                f"'{recording.file}' cannot be forked at {step * plan.step_ns / 1e9:g} s: it goes from 0 to"
                f" {last_ns / 1e9:g} s"
            )
        self.run = f"{first.run:x}"
        self._targets = _targets_by_output(parent)
        self._kept = {
            key for key, targets in _targets_by_output(plan).items() if self._targets.get(key) == targets
        }
        self._periods = plan.grant_stop_periods()

    def __iter__(self) -> Iterator[GrantMessage]:
        for grant in takewhile(lambda grant: grant.step < self._end, self._recording.grants()):
            inlets = [sample for one in grant.inlets for sample in self._entering_samples(one)]
            begin, end = grant.step, min(grant.horizon_ns // self._step_ns, self._end)
            while begin < end:
                count = min([end - begin, *(period - begin % period for period in self._periods)])
                yield grant.model_copy(
                    update={
                        "step": begin,
                        "start_ns": begin * self._step_ns,
                        "horizon_ns": (begin + count) * self._step_ns,
                        "inlets": inlets,
                    }
                )
                begin, inlets = begin + count, []

    def _entering_samples(self, sample: InletSample) -> Iterator[InletSample]:
        """Yield a sample by its device, or by the entered inputs if the inputs have another device now."""
        key = sample.participant, sample.port
        if key in self._kept or key not in self._targets:
            yield sample
            return
        for participant, port in sorted(self._targets[key]):
            yield sample.model_copy(update={"participant": participant, "port": port})


def _targets_by_output(plan: Plan) -> dict[_Key, set[_Key]]:
    """Return the inputs fed by each output of a device."""
    targets: dict[_Key, set[_Key]] = {}
    for one in plan.from_devices:
        targets.setdefault((one.source, one.source_port), set()).add((one.target, one.target_port))
    return targets
