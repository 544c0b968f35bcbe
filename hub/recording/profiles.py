"""The numbers of a profile: shares of a core, parts of a step, causes of late steps."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

from schemas.trocar_msgs import Profile

__all__ = ["profile_numbers", "profile_tables"]

_LEAST = 0.001
"""Share of a core, or of a step: smaller parts are not in tables."""

_Table = tuple[tuple[str, ...], list[tuple[str, ...]]]
"""The heads of the columns, and the rows."""


def profile_numbers(profile: Profile) -> dict[str, Any]:
    """Return the numbers of a profile, for a summary.

    `core_s_per_sim_s` is the time of processor cores in a simulated second, `by_taker` the parts, the largest
    first. `step` is the mean step of the stepping thread of each host: the wall time (s) of each of its
    phases, the time of a core (s), and the share of the phase; the hub's phases are the critical path.
    `late_causes` counts the late steps, `worst_steps` are the longest.
    """
    sim_s, steps = profile.sim_time_ns / 1e9, max(profile.steps, 1)
    takers: defaultdict[str, float] = defaultdict(float)
    of_host: defaultdict[str, float] = defaultdict(float)
    for row in profile.rows:
        takers[row.taker] += row.core_s
        of_host[row.host] += row.wall_s
    largest_first = sorted(takers.items(), key=lambda item: -item[1])
    path: dict[str, dict[str, dict[str, float]]] = {}
    for row in sorted(profile.rows, key=lambda row: -row.wall_s):
        if row.phase:
            path.setdefault(row.host, {})[row.phase] = {
                "wall_s": row.wall_s / steps,
                "core_s": row.core_s / steps,
                "share": row.wall_s / of_host[row.host],
            }
    return {
        "core_s_per_sim_s": sum(takers.values()) / sim_s if sim_s else 0.0,
        "by_taker": {taker: core_s / sim_s for taker, core_s in largest_first} if sim_s else {},
        "step": dict(sorted(path.items(), key=lambda item: (item[0] != "hub", item[0]))),
        "late_causes": {row.cause: row.steps for row in profile.late},
        "worst_steps": [
            {"sim_time_s": row.time_ns / 1e9, "took_s": row.took_s, "cause": row.cause}
            for row in profile.worst
        ],
    }


def profile_tables(numbers: Mapping[str, Any]) -> Iterator[_Table]:
    """Yield the result of `profile_numbers` as tables: shares of a core, the mean step, late steps."""
    parts = {"all": numbers["core_s_per_sim_s"], **numbers["by_taker"]}
    yield (
        ("time of", "core-seconds per simulated second"),
        [(taker, f"{core_s:.3f}") for taker, core_s in parts.items() if core_s >= _LEAST],
    )
    yield (
        ("mean step of host", "phase", "takes", "share", "of a core"),
        [
            (
                host,
                phase,
                _in_milliseconds(row["wall_s"]),
                f"{row['share']:.1%}",
                _in_milliseconds(row["core_s"]),
            )
            for host, phases in numbers["step"].items()
            for phase, row in phases.items()
            if row["share"] >= _LEAST
        ],
    )
    if numbers["late_causes"]:
        causes = numbers["late_causes"].items()
        yield ("late because of", "steps"), [(cause, f"{steps:,}") for cause, steps in causes]
        yield (
            ("longest steps end at", "take", "most of it"),
            [
                (f"{row['sim_time_s']:.3f} s", _in_milliseconds(row["took_s"]), row["cause"])
                for row in numbers["worst_steps"]
            ],
        )


def _in_milliseconds(time_s: float) -> str:
    return f"{1e3 * time_s:.3f} ms"
