"""Mutated systems of SSP: descriptions, parameter sets, mappings, archives. Each is imported, or refused.

A scenario that comes of one is checked; it runs, or its error is a ScenarioError. No FMU is loaded.

`python -m tests.fuzz.systems --number 1000 --seed 7 --hours 1`; `--case 7:123` repeats one system.
"""

from __future__ import annotations

import io
import random
import sys
import zipfile
from pathlib import Path
from tempfile import TemporaryDirectory

from engines.fmu.ssp.system_import import import_system
from hub.planning.scenario_file import load
from hub.session.launch import plan_of
from tests.engines.fmu.driving import BALL, SPRING, STAIR
from tests.engines.fmu.ssp.systems import SYSTEMS, description
from tests.engines.fmus import build
from tests.fuzz.byte_mutations import WORDS, mutated, mutated_text
from tests.fuzz.fmus import mutated_elements, pack_fmu
from tests.fuzz.harness import Note, Target, search

NAMES = sorted(SYSTEMS)
DESCRIPTIONS = {
    model: (build.HERE / model / "modelDescription.xml").read_bytes() for model in (SPRING, BALL, STAIR)
}
FMUS = {model: pack_fmu(model, text) for model, text in DESCRIPTIONS.items()}
FMUS["in_millimetres"] = pack_fmu(
    SPRING, DESCRIPTIONS[SPRING].replace(b'the mass"><Real unit="N"', b'the mass"><Real unit="mm"')
)


def _files(name: str) -> dict[str, bytes]:
    files = {"SystemStructure.ssd": description(SYSTEMS[name], name).encode()}
    return files | {file: text.encode() for file, text in SYSTEMS[name].files.items()}


def _archive(files: dict[str, bytes], fmus: tuple[str, ...]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
        for fmu in fmus:
            archive.writestr(f"resources/{fmu}.fmu", FMUS[fmu])
    return file.getvalue()


def _read(data: bytes, directory: Path) -> None:
    (directory / "system.ssp").write_bytes(data)
    with TemporaryDirectory(dir=directory) as out:
        imported = import_system(directory / "system.ssp", Path(out))
        checked = load(str(imported.file))
        plan_of(checked.scenario, checked.params)


def attempt(case: str, directory: Path, note: Note) -> None:
    """Import the system of `case`, SEED:NUMBER."""
    source = random.Random(case)
    name = source.choice(NAMES)
    files = _files(name)
    others = [text for other in NAMES for text in _files(other).values()]
    file = source.choice(sorted(files))
    change = source.choice([mutated_elements] * 4 + [mutated_text, mutated])
    label, files[file] = change(files[file], source, others)
    if source.random() < 0.05:
        word = source.choice(WORDS).decode("utf-8", "replace")[:5000]
        files[f"resources/{word}"] = b""
        label += " names"
    data = _archive(files, SYSTEMS[name].fmus)
    if source.random() < 0.1:
        what, data = mutated(data, source, [_archive(_files(other), ()) for other in NAMES])
        label += f" archive {what}"
    note(f"{name}: {file}: {label}")
    _read(data, directory)


def pristine(directory: Path) -> None:
    """Import each system as it is."""
    for name in NAMES:
        _read(_archive(_files(name), SYSTEMS[name].fmus), directory)


if __name__ == "__main__":
    sys.exit(search(Target(attempt, pristine, batch=20), __doc__ or "", hours=0.25))
