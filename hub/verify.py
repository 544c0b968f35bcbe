"""Re-simulates a recording from the recorded grants, and compares every state hash."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hub.hash_comparison import HashComparison
from hub.observation.summary import Progress
from hub.planning.plan import Plan
from hub.recording.recording import Recording
from hub.recording.trust import trusted_parameters
from hub.session.clock import most_steps
from hub.session.past import Past
from hub.session.session import Session
from schemas.errors import RecordingError
from schemas.trocar_msgs import GrantMessage

__all__ = ["VerifySummary", "verify"]


@dataclass(frozen=True)
class VerifySummary:
    """The result of a comparison: whether every state hash is the same, or the first difference.

    Examples:
        found = trocar.verify("recordings/table")
        found.same or (found.first_difference_step, found.first_difference_participant)
    """

    recording: str
    same: bool
    """Whether every recorded state hash is the same again."""
    steps: int
    hashes: int
    """State hashes compared."""
    first_difference_step: int | None
    first_difference_participant: str | None


def verify(
    recording: Recording,
    *,
    trust: bool = False,
    directory: Path | None = None,
    endpoint: str | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> VerifySummary:
    """Run the recorded session again, in new processes, with the recorded grants.

    Args:
        recording: The recording, which may be a stranger's.
        trust: Allow the demands refused by `trusted_parameters`.
        directory: Where relative paths of the scenario start, by default the recorded directory.
        endpoint: Where the hub listens on loopback; by default at a free port.
        progress: Called several times a second of wall time.

    Raises RecordingError if the recording is not of a session, and the errors of `trusted_parameters` and
    `Session.run`.
    """
    scenario = recording.scenario().model_copy(update={"pace": "fast", "measure": {}, "outcome": None})
    plan, directory = _plan(recording), directory or recording.directory()
    stepped = {name: planned for name, planned in plan.participants.items() if planned.in_step}
    parameters = trusted_parameters(recording, stepped, directory, trust=trust)
    here = {name: parameters.make(name) for name, planned in stepped.items() if planned.host == "hub"}
    comparison = HashComparison(recording, plan)
    session = Session(
        scenario,
        plan,
        {name: first for name, (first, _) in here.items()},
        directory,
        endpoint=endpoint,
        past=Past(_recorded_grants(recording, plan, most_steps(plan, scenario.window)), parameters),
        successors={name: later for name, (_, later) in here.items()},
        on_ack=comparison.compare_ack,
    )
    comparison.stop = session.state.shutdown
    ran = session.run(progress)
    first = comparison.first
    return VerifySummary(
        recording=str(recording.file),
        same=first is None,
        steps=ran.steps,
        hashes=comparison.hashes,
        first_difference_step=None if first is None else first[0],
        first_difference_participant=None if first is None else first[1],
    )


def _recorded_grants(recording: Recording, plan: Plan, most: int) -> Iterator[GrantMessage]:
    """Yield the recorded grants, of at most `most` steps.

    Raises RecordingError at a grant that does not follow the grant before, or covers more steps: a longer
    grant could not be ended.
    """
    step = 0
    for grant in recording.grants():
        end, rest = divmod(grant.horizon_ns, plan.step_ns)
        follows = (grant.step, grant.start_ns) == (step, step * plan.step_ns) and not rest
        if not follows or not step < end <= step + most:
            raise RecordingError(
                f"'{recording.file}' cannot be simulated again: the grant of step {step} should follow, and"
                f" there is one of step {grant.step}, from {grant.start_ns} to {grant.horizon_ns} ns; a grant"
                f" of this session covers at most {most} steps"
            )
        yield grant
        step = end


def _plan(recording: Recording) -> Plan:
    """Return the recorded plan, with remote participants in processes here and without outputs to devices.

    Devices are in the hub's process, where a re-simulation makes none; a host process would open devices.
    Observers have no hashes and are left out.
    """
    plan = recording.plan()
    participants = {
        name: planned.model_copy(
            update={"host": "hub" if planned.role == "device" else planned.host.replace("/", "_")}
        )
        for name, planned in plan.participants.items()
        if not planned.observer
    }
    connections = tuple(k for k in plan.connections if plan.participants[k.target].role != "device")
    return plan.model_copy(
        update={"participants": participants, "connections": connections, "to_devices": ()}
    )
