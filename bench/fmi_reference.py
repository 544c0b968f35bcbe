"""The Reference FMUs, compiled from their sources, beside FMPy and the trajectories that come with them.

git clone https://github.com/modelica/Reference-FMUs
python bench/fmi_reference.py Reference-FMUs

Each model runs over its default experiment as FMI 2.0 and FMI 3.0, in co-simulation with inputs at their
start values. For each: the largest difference of all outputs of doubles from FMPy's `simulate_fmu` and, for
models without inputs, from `<model>_out.csv`, at each communication point, after the events of this instant.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import read_model_description, simulate_fmu
from fmpy.util import read_csv

from engines.fmu.engine import FmuEngine, FmuParams
from engines.fmu.variables import port_name
from hub.participant import Inputs, Setup
from schemas.errors import TrocarError
from schemas.ros import Float64Message
from schemas.vectors import Vector

MODELS = (
    "BouncingBall",
    "Dahlquist",
    "Feedthrough",
    "Resource",
    "Stair",
    "VanDerPol",
    "Clocks",
)
_STEP_S = 0.01
"""Step of a model that states none."""
FOLDERS = {2: "linux64", 3: "x86_64-linux"}


def compiled(root: Path, model: str, version: int, folder: Path) -> Path:
    """Return the FMU of a model."""
    library, path = folder / f"{model}.so", folder / f"{model}{version}.fmu"
    sources = [root / model / "model.c", root / f"src/fmi{version}Functions.c", root / "src/cosimulation.c"]
    options = [
        "-O1",
        "-shared",
        "-fPIC",
        "-fvisibility=hidden",
        f"-DFMI_VERSION={version}",
        "-DDISABLE_PREFIX",
    ]
    folders = [f"-I{root / 'include'}", f"-I{root / model}"]
    subprocess.run(["cc", *options, *folders, *map(str, sources), "-lm", "-o", library], check=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.write(root / model / f"FMI{version}.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{FOLDERS[version]}/{model}.so")
        for resource in (root / model).glob("*.txt"):
            archive.write(resource, f"resources/{resource.name}")
    return path


def here(path: Path, steps: int, h_ns: int) -> dict[str, Vector]:
    """Return the outputs at the ends of the steps, by port."""
    with FmuEngine("model", FmuParams(path=path)) as engine:
        engine.configure(Setup(h_ns, path.parent))
        inputs = Inputs(
            {port.name: np.array(port.start) for port in engine.ports if port.causality == "input"}
        )
        names = [
            port.name
            for port in engine.ports
            if port.causality == "output" and port.type == Float64Message.ros_type
        ]
        rows = np.zeros((steps, len(names)))
        for k in range(steps):
            outputs: Any = engine.step(k * h_ns, h_ns, inputs)
            rows[k] = [outputs[name][0] for name in names]  # an engine writes to the same arrays again
        return dict(zip(names, rows.T, strict=True))


def difference(found: dict[str, Vector], table: Any, step: float) -> float:
    """Return the largest difference from a table with a column `time`, at its last row of each instant."""
    worst, times = 0.0, np.asarray(table["time"])
    for name in table.dtype.names:
        if port_name(name) not in found:
            continue
        for k, value in enumerate(found[port_name(name)].tolist(), 1):
            rows = np.flatnonzero(np.abs(times - k * step) < 1e-6 * step)
            if rows.size:
                worst = max(worst, abs(float(table[name][rows[-1]]) - value))
    return worst


def compare(root: Path, model: str, version: int, folder: Path) -> str:
    """Return a line of the table."""
    try:
        path = compiled(root, model, version, folder)
        description: Any = read_model_description(str(path), validate=False)
        experiment = description.defaultExperiment
        stop, step = float(experiment.stopTime), float(experiment.stepSize or _STEP_S)
        found = here(path, round(stop / step), round(step * 1e9))
    except TrocarError as error:
        return f"refused: {error}"
    theirs = simulate_fmu(str(path), stop_time=stop, output_interval=step, fmi_type="CoSimulation")
    reference = root / model / f"{model}_out.csv"
    has_inputs = any(row.causality == "input" for row in description.modelVariables)
    of_csv = (
        "-" if has_inputs or not reference.exists() else difference(found, read_csv(str(reference)), step)
    )
    return f"{round(stop / step):6} steps  FMPy {difference(found, theirs, step)}  CSV {of_csv}"


def main() -> None:
    """Print a line for each model and version."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sources", type=Path, help="a clone of modelica/Reference-FMUs")
    parser.add_argument("models", nargs="*", default=MODELS)
    given = parser.parse_args()
    for model in given.models:
        for version in (2, 3):
            if (given.sources / model / f"FMI{version}.xml").exists():
                with tempfile.TemporaryDirectory() as folder:
                    line = compare(given.sources, model, version, Path(folder))
                print(f"{model:13} FMI {version}.0  {line}", flush=True)


if __name__ == "__main__":
    main()
