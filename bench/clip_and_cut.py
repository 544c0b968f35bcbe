"""The routine of the scenario clip-and-cut on patients of all variations, with physics.

    python -m bench.clip_and_cut --rows rows.jsonl --patients 0 1 2    runs the patients not in the file yet
    python -m bench.clip_and_cut --rows rows.jsonl --patients          prints what is in the file

A row for each patient: the end in words, recoveries, harm to organs that must be spared, liquids lost, and
the state hash.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, cast

import trocar.sessions  # before numpy: state hashes are those of `trocar run`
from anatomy.params import AnatomyParams
from schemas.ros import StringMessage
from schemas.trocar_msgs import TissueEvent

__all__ = ["clip_and_cut"]

PATIENTS = range(20)
LEAST = 18
"""Patients of `PATIENTS` on whom the score card is to count a success."""
SPARED = ("common_bile_duct", "hepatic_artery", "liver")
_HARM = {"cut", "torn", "burnt", "clipped", "bleeding", "leaking"}
_MEASURES = ("done", "given_up", "recoveries", "sub_task", "success", "errors", "blood", "bile", "pull_n")


def run_patient(patient: int, **settings: str) -> dict[str, Any]:
    """Run the routine on a patient; return the row."""
    drawn = AnatomyParams(patient=patient).drawn
    variations = [
        f"artery {drawn.artery}",
        *(["short duct"] * drawn.short_duct),
        *(["thick wall"] * drawn.thick_wall),
        *(["stone"] * drawn.stone),
    ]
    with tempfile.TemporaryDirectory() as folder:
        summary = trocar.run(
            "clip-and-cut",
            set={"participants.tissue.anatomy.patient": patient} | settings,
            record=Path(folder) / "run",
            one_host=True,
        )
        recording = trocar.Recording(Path(folder) / "run")
        harm = {organ: found for organ in SPARED if (found := list(_harm(recording, organ)))}
        said = [cast("StringMessage", one).data for _, one in recording["routine.status"].messages()]
    return {
        "patient": patient,
        "variations": variations,
        "ending": summary.ending,
        "simulated_s": summary.sim_time_s,
        "wall_s": summary.wall_time_s,
        "state_hash": summary.state_hash,
        "harm": harm,
        "said": said,
    } | {name: summary.measures.get(name) for name in _MEASURES}


def _harm(recording: trocar.Recording, organ: str) -> Iterator[str]:
    for _, message in recording[f"tissue.{organ}/events"].messages():
        event = cast("TissueEvent", message)
        if event.kind in _HARM:
            yield f"{event.kind} {event.size:.3g} {event.unit}"


def report(rows: Sequence[dict[str, Any]]) -> int:
    """Print the table; return how many figures fall short."""
    for row in rows:
        end = "done" if row["done"] else str(row["ending"] or f"not done, sub-task {row['sub_task']:.0f}")
        print(
            f"{row['patient']:3d} {', '.join(row['variations']):32s} {row['simulated_s']:6.1f} s"
            f" recoveries {row['recoveries']:.0f} errors {row['errors'] or 0:.0f}"
            f" harm {row['harm'] or 'none'}: {end}"
        )
    done, hurt = (
        sum(bool(row["done"] and row["success"]) for row in rows),
        sum("common_bile_duct" in row["harm"] for row in rows),
    )
    print(f"successes by the card: {done} of {len(rows)}; common bile duct hurt: {hurt}")
    return int(done * len(PATIENTS) < LEAST * len(rows)) + int(hurt > 0)


def clip_and_cut() -> int:
    """Run all patients; return how many figures fall short."""
    return report([run_patient(patient) for patient in PATIENTS])


def main(arguments: Iterable[str] | None = None) -> int:
    """Run the patients asked for that have no row yet, and print the table."""
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("--rows", type=Path, required=True)
    parser.add_argument("--patients", type=int, nargs="*", default=list(PATIENTS))
    given = parser.parse_args(None if arguments is None else list(arguments))
    for patient in given.patients:
        if patient not in {row["patient"] for row in _read(given.rows)}:
            row = run_patient(patient)
            with given.rows.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
    return report(sorted(_read(given.rows), key=lambda row: row["patient"]))


def _read(rows: Path) -> list[dict[str, Any]]:
    lines = rows.read_text(encoding="utf-8").splitlines() if rows.exists() else []
    return [json.loads(line) for line in lines]


if __name__ == "__main__":
    raise SystemExit(main())
