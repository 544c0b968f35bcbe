"""Public FMUs of other tools here and in FMPy: what runs, and the largest difference of their outputs.

python bench/fmi_public.py FOLDER...

Each FMU in the folders (equal files once) takes 100 steps, in a process of its own since an FMU may crash: of
its default step size, or 10 ms, with inputs at their start values, in co-simulation or, where there is none,
in model exchange. Differences of model exchange are those of two ways to integrate. For `difference` each
output is scaled by its largest value in FMPy, if that is above 1.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

_STEPS, _STEP_S, _TIMEOUT_S = 100, 0.01, 120
_SAME = 1e-9


def in_fmpy(path: Path, step: float, model: Any) -> Any:
    """Return FMPy's table, or its error as text."""
    from fmpy import simulate_fmu

    kind = "CoSimulation" if model.coSimulation else "ModelExchange"
    starts = {
        row.name: float({"true": "1", "false": "0"}.get(row.start or "0", row.start or "0"))
        for row in model.modelVariables
        if row.causality == "input" and row.type not in ("String", "Binary", "Clock") and not row.dimensions
    }
    held = np.array(
        [(time, *starts.values()) for time in (0.0, 2.0 * _STEPS * step)],
        [("time", "f8"), *((name, "f8") for name in starts)],
    )
    try:
        return simulate_fmu(
            str(path),
            start_time=0.0,
            stop_time=_STEPS * step,
            output_interval=step,
            step_size=step,
            fmi_type=kind,
            input=held if starts else None,
            validate=False,
        )
    except Exception as error:  # noqa: BLE001  # FMPy raises a bare Exception
        return f"{type(error).__name__}: {error}"


def here(path: Path, h_ns: int, tolerance: float | None = None) -> dict[str, Any] | str:
    """Return the outputs at the ends of the steps by port, or the error as text; tolerance as in FMPy."""
    from engines.fmu.engine import FmuEngine, FmuParams
    from hub.participant import Inputs, Setup
    from schemas.errors import TrocarError

    try:
        with FmuEngine("model", FmuParams(path=path, tolerance=tolerance)) as engine:
            engine.configure(Setup(h_ns, path.parent))
            inputs = Inputs(
                {port.name: np.array(port.start or ()) for port in engine.ports if port.causality == "input"}
            )
            rows: dict[str, list[float]] = {}
            for k in range(_STEPS):
                outputs: Any = engine.step(k * h_ns, h_ns, inputs)
                for name, value in outputs.items():
                    if isinstance(value, np.ndarray) and value.size == 1:
                        rows.setdefault(name, []).append(float(value[0]))
            return dict(rows)
    except TrocarError as error:
        return str(error)


def compare(path: Path) -> dict[str, Any]:
    """Run an FMU in both."""
    from fmpy import read_model_description

    from engines.fmu.variables import port_name

    try:
        model: Any = read_model_description(str(path), validate=False)
    except Exception as error:  # noqa: BLE001  # FMPy raises a bare Exception
        found = here(path, 10_000_000)
        return {"tool": "", "fmi": "", "fmpy": str(error), "here": found if isinstance(found, str) else ""}
    experiment = model.defaultExperiment
    step = float((experiment and experiment.stepSize) or 0.0) or _STEP_S
    tolerance = float(experiment.tolerance) if experiment and experiment.tolerance else None
    theirs, ours = in_fmpy(path, step, model), here(path, round(step * 1e9), tolerance)
    row = {
        "tool": (model.generationTool or "").split("(")[0].strip(),
        "fmi": model.fmiVersion + (" CS" if model.coSimulation else " ME"),
        "fmpy": theirs if isinstance(theirs, str) else "",
        "here": ours if isinstance(ours, str) else "",
    }
    if not row["fmpy"] and not isinstance(ours, str):
        names = [name for name in theirs.dtype.names if port_name(name) in ours]
        row["outputs"] = len(names)
        worst = 0.0
        for name in names:
            there, own = np.asarray(theirs[name], float), np.array(ours[port_name(name)])
            count = min(len(there) - 1, len(own))
            worst = max(
                worst,
                float(np.abs(there[1 : count + 1] - own[:count]).max())
                / max(1.0, float(np.abs(there).max())),
            )
        row["difference"] = worst
    return row


def main() -> None:
    """Print a line for each FMU, and the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--one", action="store_true", help="print the comparison of a single FMU as JSON")
    given = parser.parse_args()
    if given.one:
        print(json.dumps(compare(given.folders[0])))
        return
    seen: set[str] = set()
    counts: Counter[str] = Counter()
    for path in sorted(file for folder in given.folders for file in folder.rglob("*.fmu")):
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        if digest in seen:
            continue
        seen.add(digest)
        command = [sys.executable, __file__, "--one", str(path)]
        try:
            run = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT_S, check=False)
            row = json.loads(run.stdout.splitlines()[-1])
        except (subprocess.TimeoutExpired, IndexError, json.JSONDecodeError) as error:
            row = {"tool": "", "fmi": "", "fmpy": "?", "here": f"no result: {type(error).__name__}"}
        if "difference" in row:
            outcome = f"both run, {row['outputs']} outputs, difference {row['difference']:.2g}"
            counts["both, same" if row["difference"] < _SAME else "both, differing"] += 1
        else:
            outcome = f"here: {row['here'][:140] or 'runs'}; FMPy: {row['fmpy'][:140] or 'runs'}"
            counts[f"here {'not' if row['here'] else 'yes'}, FMPy {'not' if row['fmpy'] else 'yes'}"] += 1
        print(f"{path.name:28} {row['fmi']:7} {row['tool'][:32]:32} {outcome}", flush=True)
    print(dict(counts))


if __name__ == "__main__":
    main()
