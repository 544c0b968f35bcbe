"""A system of SSP as a scenario, with the FMUs beside it."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any, cast

from ruamel.yaml import YAML

from engines.fmu.ssp.fmus import MODEL_EXCHANGE, RESOURCES, Fmu, load_fmus
from engines.fmu.ssp.network import End, Network, Wire, find_loop
from engines.fmu.ssp.package import open_package
from engines.fmu.ssp.settings import (
    COMPONENT_KEYS,
    SCENARIO_KEYS,
    duration_text,
    read_settings,
    stated_step,
    unread_annotations,
)
from engines.fmu.ssp.structure import Component, Description, read_description
from engines.fmu.ssp.transformations import Linear
from engines.fmu.ssp.values import StartValues
from engines.fmu.variables import port_name
from schemas.errors import ScenarioError
from schemas.quantity import same_unit
from schemas.scenario import MAX_NAME

__all__ = ["ImportedSystem", "import_system"]

_DEFAULT_STEP_S = 1e-3
_LONGEST_LINE = 300


@dataclass
class ImportedSystem:
    """A scenario, and what became of the system."""

    file: Path
    scenario: dict[str, Any]
    notes: list[str] = field(default_factory=list[str])
    """Choices of the import, each a sentence."""
    lost: list[str] = field(default_factory=list[str])
    """Parts of the system that are not in the scenario, each a sentence."""


def import_system(path: Path, directory: Path) -> ImportedSystem:
    """Write the system at `path` as a scenario with its FMUs to the new `directory`.

    Raises ScenarioError, with nothing written, for a system that cannot be run here.
    """
    if directory.exists() and any(directory.iterdir() if directory.is_dir() else [directory]):
        raise ScenarioError(f"'{directory}' exists and is not empty: name another directory with -o")
    try:
        (directory / RESOURCES).mkdir(parents=True, exist_ok=True)
        imported = _Import(path, directory).run()
        imported.file.write_text(_text(imported, path), encoding="utf-8")
    except OSError as error:
        shutil.rmtree(directory, ignore_errors=True)
        raise ScenarioError(f"'{directory}' cannot be written: {error}") from error
    except BaseException:
        shutil.rmtree(directory, ignore_errors=True)
        raise
    return imported


class _Import:
    """The parts of a system while the scenario is made."""

    def __init__(self, path: Path, directory: Path) -> None:
        self._path, self._directory = path, directory
        self._notes: list[str] = []
        self._lost: list[str] = []

    def run(self) -> ImportedSystem:
        """Return the scenario. Raises ScenarioError."""
        with open_package(self._path) as document:
            description = read_description(document)
            self._lost += description.lost + unread_annotations(description)
            root = description.root
            fmus = load_fmus(root, self._directory / RESOURCES, self._lost.append)
            if not fmus:
                raise ScenarioError(
                    f"'{self._path}' has no component that is an FMU: there is nothing to run."
                    f" {'; '.join(self._lost[:5])}"
                )
            network = Network(description, fmus, self._lost.append)
            values = StartValues(root, fmus, self._lost.append)
            wires = network.wires()
            values.follow(wires)
            components = [one for one in root.components() if one.path in fmus]
            names = self._names(components)
            participants = {
                names[one.path]: self._participant(one, fmus[one.path], values.of(one.path))
                for one in components
            }
            connections = self._connect(wires, fmus, participants, names)
            self._view(network, fmus, names)
        scenario = self._session(description, fmus) | {"participants": participants}
        if connections:
            scenario["connections"] = connections
        file = self._directory / f"{scenario['name']}.yaml"
        return ImportedSystem(file, scenario, self._notes, self._lost)

    def _names(self, components: Iterable[Component]) -> dict[tuple[str, ...], str]:
        """Return the names of participants: the path with underscores."""
        names: dict[tuple[str, ...], str] = {}
        for component in components:
            name = _unique(_identifier("_".join(component.path), "fmu"), set(names.values()))
            names[component.path] = name
            if name != component.label:
                self._notes.append(f"component '{component.label}' is participant '{name}'")
        return names

    def _participant(self, component: Component, fmu: Fmu, start: dict[str, Any]) -> dict[str, Any]:
        spec: dict[str, Any] = {"kind": "fmu", "path": f"{RESOURCES}/{fmu.file.name}"}
        if not fmu.strict:
            spec["strict"] = False
        if component.implementation == MODEL_EXCHANGE and fmu.model.coSimulation:
            spec["solver"] = "cvode"
        if start:
            spec["start"] = start
            try:
                fmu.describe(start)
            except ScenarioError as error:
                raise ScenarioError(f"{component.place}: component '{component.label}': {error}") from error
        return spec | read_settings([component.annotations], COMPONENT_KEYS)

    def _connect(
        self,
        wires: Sequence[Wire],
        fmus: Mapping[tuple[str, ...], Fmu],
        participants: dict[str, dict[str, Any]],
        names: Mapping[tuple[str, ...], str],
    ) -> list[str]:
        """Return the connections; conversions are added to the participants."""
        connections: list[str] = []
        for wire in wires:
            source, target = wire.source, wire.target
            text = f"{wire.place}: the connection {source} -> {target}"
            if source.path not in fmus:
                if target.name not in participants[names[target.path]].get("start", {}):
                    self._lost.append(f"{text}: '{source}' of the system has no source and no value")
                continue
            ends = [(end, port_name(end.name)) for end in (source, target)]
            missing = [end for end, port in ends if port not in fmus[end.path].ports]
            if missing:
                row = fmus[missing[0].path].variables[missing[0].name]
                self._lost.append(
                    f"{text}: '{missing[0]}' is a {row.row.type} of causality {row.causality}, which has no"
                    " connection here"
                )
                continue
            self._convert(wire, fmus, participants[names[target.path]])
            connections.append(" -> ".join(f"{names[end.path]}.{port}" for end, port in ends))
        if loop := find_loop([wire for wire in wires if wire.source.path in fmus]):
            named = ", ".join(f"{wire.source} -> {wire.target}" for wire in loop)
            self._notes.append(
                f"connections form a loop: {named}. It is not iterated: each FMU reads the values of the last"
                " communication point. Where outputs follow inputs at once, choose a step in which that does"
                " not matter"
            )
        return connections

    def _convert(self, wire: Wire, fmus: Mapping[tuple[str, ...], Fmu], spec: dict[str, Any]) -> None:
        """Add the conversion of a wire to the participant at its end."""
        source = fmus[wire.source.path].variables[wire.source.name].unit
        target = fmus[wire.target.path].variables[wire.target.name].unit
        conversion: dict[str, Any] = {}
        if source and target and not same_unit(source.name, target.name):
            conversion["unit"] = source.name
        if isinstance(wire.change, Linear):
            conversion |= {} if wire.change.factor == 1.0 else {"factor": wire.change.factor}
            conversion |= {} if wire.change.offset == 0.0 else {"offset": wire.change.offset}
            if wire.change.factor == 0.0:
                raise ScenarioError(
                    f"{wire.place}: a factor of 0 makes '{wire.target}' constant: give it a value"
                )
        else:
            conversion["table"] = dict(wire.change.entries)
        if conversion:
            spec.setdefault("inputs", {})[wire.target.name] = conversion

    def _view(
        self, network: Network, fmus: Mapping[tuple[str, ...], Fmu], names: Mapping[tuple[str, ...], str]
    ) -> None:
        """Report the outputs of the outermost system: a scenario has none."""
        for wire in network.views():
            if wire.source.path in fmus:
                end: End = wire.source
                self._lost.append(
                    f"{wire.place}: output '{wire.target}' of the system: read"
                    f" '{names[end.path]}.{port_name(end.name)}'"
                )

    def _session(self, description: Description, fmus: Mapping[tuple[str, ...], Fmu]) -> dict[str, Any]:
        settings = read_settings(description.annotations, SCENARIO_KEYS)
        name = _identifier(description.name, "system")
        if name != description.name:
            self._notes.append(f"the system '{description.name}' is scenario '{name}'")
        scenario: dict[str, Any] = {"name": name} | settings
        if "step" not in settings:
            scenario["step"] = self._step(description, fmus)
        if description.start_time:
            self._lost.append(f"startTime {description.start_time:g} s: simulated time begins at 0")
        if "duration" not in settings and description.stop_time is not None:
            scenario["duration"] = duration_text(description.stop_time - description.start_time)
        if "duration" not in scenario:
            self._notes.append("the system states no stopTime: state a 'duration', or stop the session")
        if not settings and len(fmus) > 1:
            scenario["algorithm"] = "jacobi"
            self._notes.append(
                "algorithm: jacobi, as SSP states none: values are exchanged at communication points"
            )
        return scenario

    def _step(self, description: Description, fmus: Mapping[tuple[str, ...], Fmu]) -> str:
        found = stated_step(description)
        if found is None:
            least = min((step for fmu in fmus.values() if (step := fmu.step_s)), default=0.0)
            found = (least, "the FMUs' own") if least else (_DEFAULT_STEP_S, "the default")
        step, origin = found
        text = duration_text(step)
        if round(step * 1e9) == 0:
            raise ScenarioError(f"a step of {step:g} s ({origin}) is less than a nanosecond")
        self._notes.append(f"step {text}, {origin}: SSP states none")
        return text


def _identifier(text: str, default: str) -> str:
    """Return a text as a name of a scenario or participant."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_")[:MAX_NAME]
    return name if name and name[0].isalpha() else f"{default}_{name}"[:MAX_NAME].rstrip("_")


def _unique(name: str, taken: set[str]) -> str:
    number, unique = 1, name
    while unique in taken:
        number += 1
        unique = f"{name[: MAX_NAME - 5]}_{number}"
    return unique


def _text(imported: ImportedSystem, path: Path) -> str:
    """Return the scenario file, with the report as comments."""
    stream, yaml = StringIO(), cast("Any", YAML(typ="safe", pure=True))
    yaml.default_flow_style, yaml.width, yaml.sort_base_mapping_type_on_output = False, 10**6, False
    yaml.dump(imported.scenario, stream)
    lines = [f"From the system {path.name}.", *imported.notes]
    lines += [f"not carried over: {line}" for line in imported.lost]
    return "".join(f"# {_one_line(line)}\n" for line in lines) + "\n" + stream.getvalue()


def _one_line(text: str) -> str:
    return "".join(letter if letter.isprintable() else "?" for letter in text[:_LONGEST_LINE])
