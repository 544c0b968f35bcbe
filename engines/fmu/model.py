"""An FMU's modelDescription.xml, read by FMPy and checked before any use of its names."""

from __future__ import annotations

import logging
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from engines.fmu.archive import opened_archive
from engines.fmu.clock import complete_clocks
from engines.fmu.sources import NO_COMPILER, find_compiler, listed_sources
from engines.fmu.start import settable, unit_of
from schemas.errors import MissingExtraError, ScenarioError

if TYPE_CHECKING:
    from typing import IO

    from fmpy.model_description import InterfaceType, ModelDescription

__all__ = ["interface_of", "library_path", "read_model", "suggested_tolerance"]

_log = logging.getLogger(__name__)

_DERIVATIVES = re.compile(rb"<CoSimulation\b[^>]*\bprovidesDirectionalDerivatives\s*=\s*[\"'](true|1)[\"']")
"""Attribute of FMI 3.0: FMPy 0.3 reads only FMI 2.0's, without the last letter."""
_LONGEST_REASON = 1000
"""Most letters of a report of FMPy: FMPy quotes values of any length."""


def read_model(path: Path, *, strict: bool) -> tuple[ModelDescription, int, list[str]]:
    """Return the description of the FMU at `path`, the major version of FMI, and the names in the archive.

    Rules of FMI found broken by FMPy are logged: many working FMUs break some. If a broken rule stops FMPy's
    check, or a name is unfit for display, the error names variable and line; `strict` false ignores the
    former.

    Raises ScenarioError, and MissingExtraError without FMPy.
    """
    try:
        import fmpy  # noqa: F401  # pyright: ignore[reportUnusedImport]
    except ImportError as error:
        raise MissingExtraError("engine 'fmu'", "fmu", "fmpy") from error
    if not path.exists():
        raise ScenarioError(f"the FMU '{path}' does not exist")
    try:
        with opened_archive(path) as (file, archive):
            model, names = _read(path, file, strict=strict), archive.namelist()
            major = int(model.fmiVersion.split(".")[0])
            if model.coSimulation is not None and _DERIVATIVES.search(archive.read("modelDescription.xml")):
                model.coSimulation.providesDirectionalDerivative = True
            if any(row.type == "Clock" for row in model.modelVariables):
                complete_clocks(model, archive.read("modelDescription.xml"))
    except ScenarioError:
        raise
    except Exception as error:  # FMPy raises BadZipFile, KeyError, XMLSyntaxError, TypeError, bare Exception
        found = _shown(str(error), most=_LONGEST_REASON)
        if "(line " in str(error):
            raise ScenarioError(f"'{path}': modelDescription.xml breaks a rule of FMI: {found}") from error
        raise ScenarioError(f"'{path}' is no FMI 2.0 or 3.0 FMU: {type(error).__name__}: {found}") from error
    if major not in (2, 3):
        raise ScenarioError(f"'{path}' is an FMI {_shown(model.fmiVersion)} FMU; FMI 2.0 and 3.0 are allowed")
    _check_texts(path, model)
    return model, major, names


def _read(path: Path, file: IO[bytes], *, strict: bool) -> ModelDescription:
    from fmpy import read_model_description
    from fmpy.model_description import ValidationError

    try:
        return read_model_description(file)
    except ValidationError as error:
        _log.warning("%s: modelDescription.xml breaks rules of FMI: %s", path, "; ".join(error.problems))
        return read_model_description(file, validate=False)
    except Exception as error:
        model = read_model_description(file, validate=False)  # if this fails as well, its error is clearer
        problem = "; ".join(_undefined_display_units(model)) or f"{type(error).__name__}: {error}"
        problem = _shown(problem, most=_LONGEST_REASON)
        if strict:
            raise ScenarioError(
                f"'{path}': modelDescription.xml breaks rules of FMI: {problem}. Export the FMU again with a"
                " corrected one, or load it all the same with 'strict: false'."
            ) from error
        _log.warning("%s: modelDescription.xml breaks rules of FMI: %s", path, problem)
        return model


def _undefined_display_units(model: ModelDescription) -> Iterator[str]:
    """Yield the variables of a failing check in FMPy itself: a display unit without a defined unit."""
    units = {unit.name for unit in model.unitDefinitions}
    for row in model.modelVariables:
        if row.displayUnit is not None and unit_of(row) not in units:
            yield (
                f"variable '{_shown(row.name)}' (line {row.sourceline}) has the display unit"
                f" '{_shown(row.displayUnit)}' and no unit that the FMU defines"
            )


def _check_texts(path: Path, model: ModelDescription) -> None:
    """Refuse names and units readable as commands by terminals and pages.

    FMI's flat names exclude carriage return, line feed and tab (FMI 2.0.4 section 2.2.9); angle brackets
    occur in quoted Modelica names alone.
    """
    for row in model.modelVariables:
        if row.causality in {"input", "output"} or settable(row):
            if not row.name:  # FMPy's check, which refuses this, may be off
                raise ScenarioError(
                    f"the FMU '{path}' is refused: a variable (line {row.sourceline}) has no name"
                )
            for kind, text in (("name", row.name), ("unit", unit_of(row))):
                if not text.isprintable() or "<" in text or ">" in text:
                    raise ScenarioError(
                        f"the FMU '{path}' is refused: the {kind} {_shown(text)!r} of a variable (line"
                        f" {row.sourceline}) has a control character or an angle bracket"
                    )


def _shown(text: str, *, most: int = 80) -> str:
    """Return the first `most` letters of `text`, for display in a line."""
    return "".join(letter if letter.isprintable() else "?" for letter in text[:most])


def interface_of(
    path: Path, model: ModelDescription, major: int, names: Collection[str], solver: str | None
) -> InterfaceType:
    """Return the used interface of an FMU with the archive entries `names`.

    Co-simulation, if there is a choice; `solver`: `cvode` for model exchange. Raises ScenarioError if there
    is none for this platform.
    """
    found = model.modelExchange if solver else model.coSimulation or model.modelExchange
    if found is None:
        has = "co-simulation" if model.coSimulation else "scheduled execution"
        remedy = (
            "leave 'solver' out" if model.coSimulation else "export it for co-simulation or model exchange"
        )
        raise ScenarioError(f"'{path}' is for {has} only; {remedy}")
    library = library_path(found.modelIdentifier, major)
    if library not in names:
        _require_compiler(path, library, names, has_sources=bool(listed_sources(model)))
    return found


def suggested_tolerance(model: ModelDescription) -> float | None:
    """Return the relative tolerance of the FMU's default experiment, if it is one."""
    stated = model.defaultExperiment and model.defaultExperiment.tolerance
    try:
        tolerance = float(stated or 0.0)
    except ValueError:
        return None
    return tolerance if 0.0 < tolerance < 1.0 else None


def library_path(identifier: str, major: int) -> str:
    """Return where an FMU has the library for this platform."""
    import fmpy

    platform = fmpy.platform if major == 2 else fmpy.platform_tuple
    return f"binaries/{platform}/{identifier}{fmpy.sharedLibraryExtension}"


def _require_compiler(path: Path, library: str, names: Collection[str], *, has_sources: bool) -> None:
    """Raise ScenarioError for an FMU without its library, unless the library can be compiled."""
    if has_sources and find_compiler():
        return
    platform = library.split("/")[1]
    files = [name for name in names if name.startswith("binaries/") and not name.endswith("/")]
    if has_sources:
        raise ScenarioError(f"'{path}' is an FMU of C sources for this platform, {platform}: {NO_COMPILER}")
    here = sorted(name.split("/", 2)[2] for name in files if name.startswith(f"binaries/{platform}/"))
    if here or f"binaries/{platform}/" in names:
        raise ScenarioError(
            f"'{path}' has no file '{_shown(library)}', the library that its modelDescription.xml names"
            f" (modelIdentifier). That folder holds: {', '.join(here) or 'nothing'}."
        )
    platforms = sorted({name.split("/")[1] for name in files if name.count("/") > 1})
    raise ScenarioError(
        f"'{path}' has no binary for this platform, {platform}; it has: {', '.join(platforms) or 'none'}"
    )
