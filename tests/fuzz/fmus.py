"""Mutated FMUs, their modelDescription.xml and their archive: each has ports, or raises ScenarioError.

No FMU is loaded: its library is a program, and here not even that.

`python -m tests.fuzz.fmus --number 1000 --seed 7 --hours 1`; `--case 7:123` repeats one FMU.
"""

from __future__ import annotations

import io
import random
import sys
import zipfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import fmpy

from tests.engines.fmus import build
from tests.fuzz.byte_mutations import WORDS, mutated, mutated_text
from tests.fuzz.harness import Note, Target, search
from tests.participants import make_participant

MODELS = sorted(build.FOLDERS)
PLATFORMS = {fmpy.platform, fmpy.platform_tuple}
NUMBERS = [
    "-1",
    "0",
    "3",
    "1e9",
    "1e999",
    "NaN",
    "INF",
    "4294967296",
    "99999999999",
    "1 2 3",
    "0.5",
    "1e-300",
]
STARTS = ["m", "c", "u", "size", "h", "stage", "counter", "big", "label", "locked"]


@cache
def _description(model: str) -> bytes:
    return (build.HERE / model / "modelDescription.xml").read_bytes()


def pack_fmu(model: str, description: bytes, names: tuple[str, ...] = ()) -> bytes:
    """Return the archive of an FMU with a file where the library would be, and others."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", description)
        for platform in sorted(PLATFORMS):
            archive.writestr(f"binaries/{platform}/{model}{fmpy.sharedLibraryExtension}", b"no library")
        for name in names:
            archive.writestr(name, b"")
    return file.getvalue()


def _read(data: bytes, directory: Path, *, strict: bool, start: dict[str, object] | None = None) -> None:
    """Make the engine of a scenario with this FMU, and its ports."""
    (directory / "plant.fmu").write_bytes(data)
    params = {"path": "plant.fmu", "strict": strict, "start": start or {}}
    _ = make_participant("fmu", "plant", params, directory).ports


def mutated_elements(description: bytes, source: random.Random, others: Sequence[bytes]) -> tuple[str, bytes]:
    """Return what was done to elements and attributes, and the description, which is still XML."""
    root = ElementTree.fromstring(description)
    every = list(root.iter())
    pool = [element for other in [description, *others] for element in ElementTree.fromstring(other).iter()]
    names: list[str] = []
    for _ in range(source.choice([1, 1, 2, 3, 10])):
        element, other = source.choice(every), source.choice(pool)
        match source.randrange(6):
            case 0 | 1 | 2 if element.attrib:
                names.append("attribute")
                values = [value for one in pool for value in one.attrib.values()]
                hostile = source.choice(WORDS).decode("ascii", "ignore")[:5000]
                value = source.choice([source.choice(values), hostile, source.choice(NUMBERS)])
                shown = "".join(letter for letter in value if letter.isprintable())
                element.set(source.choice(list(element.attrib)), shown)
            case 3 if element.attrib:
                names.append("no attribute")
                del element.attrib[source.choice(list(element.attrib))]
            case 4:
                names.append("more elements")
                element.extend([other] * source.choice([1, 2, 100]))
            case _:
                names.append("no element")
                if len(element):
                    element.remove(source.choice(list(element)))
    return "+".join(names), ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def attempt(case: str, directory: Path, note: Note) -> None:
    """Read the FMU of `case`, SEED:NUMBER."""
    source = random.Random(case)
    model = source.choice(MODELS)
    others = [_description(other) for other in MODELS]
    description, label, names = _description(model), "", tuple[str, ...]()
    if source.random() < 0.85:
        change = source.choice([mutated_elements] * 4 + [mutated_text, mutated])
        label, description = change(description, source, others)
    if source.random() < 0.05:
        words = [word.decode("utf-8", "replace")[:5000] for word in source.choices(WORDS, k=2)]
        names, label = (f"resources/{words[0]}", f"x{words[1]}"), f"{label} names"
    data = pack_fmu(model, description, names)
    if not label or source.random() < 0.1:
        change, data = mutated(data, source, [pack_fmu(other, _description(other)) for other in MODELS])
        label += f" archive {change}"
    note(f"{model}: {label}")
    start = {source.choice(STARTS): source.choice([1, -1, 2**70, 1e400, "1 m", "x", [1, 2], True, None])}
    _read(data, directory, strict=source.random() < 0.7, start=start if source.random() < 0.2 else None)


def pristine(directory: Path) -> None:
    """Read each FMU as it is."""
    for model in MODELS:
        _read(pack_fmu(model, _description(model)), directory, strict=True)


if __name__ == "__main__":
    sys.exit(search(Target(attempt, pristine, batch=20), __doc__ or "", hours=0.25))
