"""Pages of the reference, made from the code when the site is built; a hook of MkDocs (mkdocs.yml).

Command line from typer, scenario and kinds from their pydantic models, ports from the shipped scenarios,
messages from `schemas`. Nothing of it is written by hand.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import typer.main
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from typer.core import TyperArgument, TyperCommand, TyperGroup, TyperOption

import trocar
from hub.command_line.app import app
from hub.participant import Stepped
from hub.planning import limits, registry
from hub.planning.scenario_file import installed_scenarios, load
from schemas import crtk, quantity, ros, trocar_msgs, visualization
from schemas.message import Message, msg_text
from schemas.ports import Port, bond_ports
from schemas.scenario import MAX_NAME, Scenario

ROOT = Path(__file__).resolve().parents[2]

EXAMPLES: Mapping[str, tuple[str, str]] = {
    "keyboard": ("keys", ""),
    "libovr": ("teleop", "participants.head={kind: libovr}"),
    "openxr": ("teleop", "participants.head={kind: openxr}"),
    "practice-task": ("pick", "participants.task={kind: practice-task}"),
    "ros1": ("ros", "participants.ros.kind=ros1"),
    "ros2-dds": ("ros", "participants.ros.kind=ros2-dds"),
    "touch": ("table", "participants.stylus={kind: touch, styluses: {right: {}}}"),
}
"""Kind to a scenario and an override in which it stands, where no shipped scenario has it by itself."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages to the site, and the kinds to its navigation."""
    kinds = [f"reference/kinds/{name}.md" for name in registry.kinds()]
    for section in config.nav or []:
        for title, pages in section.items():
            if title == "Reference":
                pages[pages.index("reference/kinds.md")] = {"Kinds": ["reference/kinds.md", *kinds]}
    for path, text in generated().items():
        files.append(File.generated(config, path, content=text))
    return files


def generated() -> dict[str, str]:
    """Return every generated page by its path in the site."""
    pages = {
        "reference/command-line.md": command_line(),
        "reference/scenario.md": scenario(),
        "reference/kinds.md": kind_index(),
        "reference/messages.md": messages(),
        "reference/api.md": api(),
        "contributing.md": _from_root("CONTRIBUTING.md"),
        "changelog.md": _from_root("CHANGELOG.md"),
    }
    scenes = _participants()
    return pages | {f"reference/kinds/{name}.md": kind_page(name, scenes) for name in registry.kinds()}


def _from_root(name: str) -> str:
    text = (ROOT / name).read_text("utf-8")
    text = re.sub(r"\]\(docs/([^)]+)\)", r"](\1)", text.replace("](CHANGELOG.md)", "](changelog.md)"))
    return re.sub(r"\[([^]]+)\]\((?!https?:)[^)]*(?<!\.md)\)", r"\1", text)  # files that are not of the site


# Command line


def command_line() -> str:
    """Return the page on the command line."""
    root = typer.main.get_command(app)
    if not isinstance(root, TyperGroup):
        raise TypeError("the command line is a group of commands")
    lines = [
        "# Command line",
        "",
        "Results go to stdout (`--json` where a program reads them), progress and logs to stderr.",
        "`trocar --install-completion` completes commands and scenario names in the shell.",
        "",
        "| exit code | meaning |",
        "|---|---|",
        "| 0 | done |",
        "| 1 | the session failed: a participant raised, died or stopped answering, or a re-simulation"
        " differs |",
        "| 2 | bad usage or an invalid scenario: nothing was started |",
        "",
        *_options_table(root),
    ]
    for path, command in _commands(root, "trocar"):
        lines += [f"## {path}", "", *_usage(path, command), "", _prose(command.help), ""]
        lines += _options_table(command)
    return "\n".join(lines)


def _commands(group: TyperGroup, path: str) -> Iterator[tuple[str, TyperCommand]]:
    for name, command in sorted(group.commands.items()):
        if isinstance(command, TyperGroup):
            yield from _commands(command, f"{path} {name}")
        else:
            yield f"{path} {name}", command


def _usage(path: str, command: TyperCommand | TyperGroup) -> list[str]:
    words = command.collect_usage_pieces(typer.Context(command))
    return ["```text", " ".join([path, *words]), "```"]


def _options_table(command: TyperCommand | TyperGroup) -> list[str]:
    rows: list[str] = []
    for param in command.params:
        default = (
            "" if param.default in (None, False, ()) or callable(param.default) else f"`{param.default}`"
        )
        text = getattr(param, "help", None) or ""
        if isinstance(param, TyperOption):
            if param.hidden:
                continue
            metavar = "" if param.is_flag else f" {_metavar(param)}"
            name = ", ".join(f"`{opt}{metavar}`" for opt in (*param.opts, *param.secondary_opts))
        else:
            name = f"`{_metavar(param)}`"
        rows.append(f"| {name} | {default} | {_cell(text)} |")
    return ["| argument or option | default | |", "|---|---|---|", *rows, ""] if rows else []


def _metavar(param: TyperOption | TyperArgument) -> str:
    return param.metavar or (param.name or "").upper()


# Parameters from JSON schemas


def scenario() -> str:
    """Return the page on the scenario file."""
    schema = Scenario.model_json_schema()
    return "\n".join(
        [
            "# Scenario file",
            "",
            "A scenario is a YAML file that describes a session. Quantities are a number in SI units or a"
            " text with its unit (`80 mm`, `10 kPa`, `1 ms`). `trocar check FILE` checks it without starting"
            " anything; `trocar schema > scenario.schema.json` writes the JSON schema for editors, with the"
            " parameters of every kind installed on your machine.",
            "",
            "YAML merge keys (`<<: *scene`) are allowed. Every value can be overridden on the command line:"
            ' `--set participants.tissue.organs.block.young_modulus="25 kPa"`. The part'
            " `participants.` may be left out.",
            "",
            *_scenario_limits(),
            *_model("Top level", schema),
            *_definitions(schema),
        ]
    )


def _scenario_limits() -> list[str]:
    """Return the section on what a scenario may contain at most."""
    rows = (
        (f"{limits.MAX_BYTES // 1024} KiB", "the file with its comments, and the text of a `--set`"),
        (limits.MAX_VALUES, "keys and values, with aliases (`*name`) and merge keys written out"),
        (limits.MAX_ITEMS, "items of one list or mapping"),
        (limits.MAX_DEPTH, "levels of lists and mappings in one another"),
        (limits.MAX_TEXT, "characters of one text"),
        (limits.MAX_NUMBER, "characters of one number"),
        (quantity.MAX_LENGTH, "characters of a quantity with its unit"),
        (MAX_NAME, "characters of the name of a session, participant, host or measure"),
        (limits.MAX_KIND, "characters of a kind that is named `module:Class`"),
        (limits.MAX_PARTICIPANTS, "participants"),
        (limits.MAX_SCENE_VALUES, "values that all participants get from `scene` together"),
    )
    return [
        "## Limits",
        "",
        "A file beyond these limits is rejected with exit code 2 and a message that names the place. A text"
        " contains no control characters but tab and line end, and a key is a text. Long data, such as"
        " trajectories and recordings, belong in files of their own.",
        "",
        "| at most | of |",
        "|---|---|",
        *(f"| {most} | {what} |" for most, what in rows),
        "",
    ]


def _definitions(schema: Mapping[str, Any]) -> list[str]:
    lines: list[str] = []
    for name, definition in sorted(schema.get("$defs", {}).items()):
        if "properties" in definition:
            lines += _model(name.lstrip("_"), definition)
        elif "enum" in definition:
            lines += [f"## {name.lstrip('_')}", "", _type(definition), ""]
    return lines


def _model(title: str, schema: Mapping[str, Any]) -> list[str]:
    required = set(schema.get("required", ()))
    lines = [f"## {title}", "", _prose(schema.get("description")), ""]
    if not schema.get("properties"):
        return [*lines, "No parameters.", ""]
    lines += ["| parameter | type | default | |", "|---|---|---|---|"]
    for name, part in schema["properties"].items():
        default = "**required**" if name in required else _default(part)
        text = part.get("description", "")
        generic = re.match(r"(a number in|seconds), or a text|a number in", text)
        lines.append(f"| `{name}` | {_type(part)} | {default} | {'' if generic else _cell(text)} |")
    return [*lines, ""]


_A_TIME = "1 ms"
"""The example that the schema of a duration states; its default is in nanoseconds."""


def _example(part: Mapping[str, Any]) -> Any:
    """Return the first example of a type, or of one of its alternatives."""
    for place in (part, *part.get("anyOf", ())):
        if place.get("examples"):
            return place["examples"][0]
    return None


def _default(part: Mapping[str, Any]) -> str:
    if "default" not in part or part["default"] is None:
        return ""
    value = part["default"]
    if isinstance(value, int) and _example(part) == _A_TIME:
        return f"`{value / 1e6:g} ms`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, float):
        return f"`{value:.6g}`"
    if isinstance(value, dict | list) and len(str(value)) > 60:
        return ""
    return f"`{value}`" if value not in ("", {}, []) else ""


def _type(part: Mapping[str, Any]) -> str:
    """Return the type of a JSON schema in words, with its limits."""
    if "$ref" in part:
        name = part["$ref"].rpartition("/")[2]
        return f"[{name.lstrip('_')}](#{name.lstrip('_').lower()})"
    if "allOf" in part:
        return _type(part["allOf"][0])
    if "const" in part:
        return f"`{part['const']}`"
    if "enum" in part:
        return ", ".join(f"`{value}`" for value in part["enum"])
    if any(word in part for word in ("anyOf", "oneOf")):
        return _alternatives(part)
    match part.get("type"):
        case "array" if "prefixItems" in part:
            kinds = [_type(item) for item in part["prefixItems"]]
            same = len(set(kinds)) == 1
            return f"{len(kinds)} x {kinds[0]}" if same else "list: " + "; ".join(kinds)
        case "array":
            return f"list of {_type(part.get('items', {}))}"
        case "object":
            inner = part.get("additionalProperties")
            return f"by name: {_type(inner)}" if isinstance(inner, Mapping) else "mapping"
        case "string":
            return "path" if part.get("format") == "path" else "text"
        case "integer" | "number" as kind:
            return kind + _limits(part)
        case None:
            return "any"
        case other:
            return str(other)


def _alternatives(part: Mapping[str, Any]) -> str:
    options = [option for option in part.get("anyOf", part.get("oneOf", ())) if option.get("type") != "null"]
    if part.get("examples") and {option.get("type") for option in options} == {"number", "string"}:
        return f"quantity, such as `{part['examples'][0]}`{_limits(part)}"
    return " or ".join(dict.fromkeys(_type(option) for option in options))


def _limits(part: Mapping[str, Any]) -> str:
    signs = {
        ">": ("exclusiveMinimum", "gt"),
        "≥": ("minimum", "ge"),
        "<": ("exclusiveMaximum", "lt"),
        "≤": ("maximum", "le"),
    }
    found = [f"{sign} {part[key]:g}" for sign, keys in signs.items() for key in keys if key in part]
    return f", {', '.join(found)}" if found else ""


# Kinds


def kind_index() -> str:
    """Return the page that lists every installed kind."""
    lines = [
        "# Kinds of participants",
        "",
        "`kind:` of a participant names one of these. Other packages add kinds by entry points of the groups"
        " `trocar.engines`, `trocar.controllers` and `trocar.devices`; `module:Class` names a class on"
        " `PYTHONPATH`. `trocar doctor` reports which work on a machine.",
        "",
    ]
    for role in ("engine", "controller", "device"):
        lines += [f"## {role.capitalize()}s", "", "| kind | |", "|---|---|"]
        for name, kind in registry.kinds().items():
            if kind.role == role:
                lines.append(f"| [`{name}`](kinds/{name}.md) | {_cell(_summary(registry.load(name)))} |")
        lines.append("")
    return "\n".join(lines)


def kind_page(name: str, scenes: Mapping[str, tuple[str, str, tuple[Port, ...]]]) -> str:
    """Return the page of one kind: what it does, its parameters, its ports in a shipped scenario."""
    kind, loaded = registry.find(name), registry.load(name)
    schema = loaded.params_model.model_json_schema()
    interface = "Stepped" if issubclass(loaded, Stepped) else "Device"
    lines = [
        f"# {name}",
        "",
        f"{kind.role.capitalize()} of the package `{kind.distribution}`, class `{kind.entry.value}`"
        f" (`{interface}`).{_extra(kind)}",
        "",
        _prose(inspect.getdoc(loaded)),
        "",
        *_model("Parameters", schema),
        "Beside these a participant has `host`, `period`, and a device `network_link` and `rate_limit`: see"
        " [the scenario file](../scenario.md#participantspec).",
        "",
        *_definitions(schema),
        "## Ports",
        "",
    ]
    if name not in scenes:
        return "\n".join([*lines, "They follow from the file that it is given; `trocar check` shows them."])
    scene, participant, ports = scenes[name]
    lines += [
        f"Ports follow from the parameters. These are those of `{participant}` in the scenario `{scene}`:",
        "",
        "| port | | type | unit | frame | |",
        "|---|---|---|---|---|---|",
        *(_port(port) for port in ports),
    ]
    return "\n".join(lines)


def _extra(kind: registry.Kind) -> str:
    known = (kind.entry.dist.metadata.get_all("Provides-Extra") if kind.entry.dist else None) or []
    return f" Install it with `pip install '{kind.distribution}[{kind.name}]'`." if kind.name in known else ""


def _port(port: Port) -> str:
    direction = f"{port.causality}, {port.variability}"
    short = port.type.replace("/msg/", "/")
    rate = f"every {port.period_ns / 1e6:g} ms" if port.period_ns else ""
    text = "; ".join(part for part in (port.description, rate) if part)
    return f"| `{port.name}` | {direction} | `{short}` | {port.unit} | {port.frame} | {_cell(text)} |"


def _participants() -> dict[str, tuple[str, str, tuple[Port, ...]]]:
    """Return for each kind the first scenario that has it, the participant there, and its ports."""
    places = [(name, "") for name in ("palpation", "cart", *installed_scenarios())]
    found: dict[str, tuple[str, str, tuple[Port, ...]]] = {}
    for scene, override in [*places, *EXAMPLES.values()]:
        loaded = load(scene, [override] if override else [])
        for name, spec in loaded.scenario.participants.items():
            if spec.kind not in found:
                made = registry.load(spec.kind)(name, loaded.params[name])
                bonds = made.bonds if isinstance(made, Stepped) else ()
                with made:
                    ports = (*made.ports, *(port for bond in bonds for port in bond_ports(bond)))
                found[spec.kind] = (scene, name, ports)
    return found


# Messages


def messages() -> str:
    """Return the page on messages and keys."""
    lines = [
        "# Messages and keys",
        "",
        "Everything on the wire, in a recording and towards ROS is a ROS 2 message in CDR. SI units, radians,"
        " seconds; quaternions (x, y, z, w). Standard types are used wherever one exists; those of the"
        " package `trocar_msgs` are below.",
        "",
        "## Keys",
        "",
        "| Zenoh key | |",
        "|---|---|",
        "| `trocar/<session>/hub/grant`, `hub/status` | grants and state of the session |",
        "| `trocar/<session>/engine/<name>/ack` | acks of those on other machines; a recording has all |",
        "| `trocar/<session>/engine/<name>/out/<port>` | values of its outputs |",
        "| `trocar/<session>/device/<name>/out/<port>` | samples of a device |",
        "| `trocar/<session>/control/<verb>` | queries: join, pause, step, set, shutdown |",
        "| `trocar/<session>/alive/<role>/<name>` | liveliness |",
        "",
        "A recording has the same topics without `trocar/<session>`.",
        "",
        "## trocar_msgs",
        "",
    ]
    for model in _models(trocar_msgs):
        lines += [f"### {model.ros_type.rpartition('/')[2]}", "", _prose(inspect.getdoc(model)), ""]
        lines += ["```text", msg_text(model).rstrip(), "```", ""]
        notes = _field_notes(model)
        lines += [f"- `{field}`: {_cell(text)}" for field, text in notes.items()]
        lines.append("")
    lines += ["## Standard types", "", "| type | fields |", "|---|---|"]
    for module in (ros, crtk, visualization):
        for model in _models(module):
            fields = "; ".join(f"`{line}`" for line in msg_text(model).splitlines())
            lines.append(f"| `{model.ros_type.replace('/msg/', '/')}` | {fields} |")
    return "\n".join(lines)


def _models(module: Any) -> list[type[Message]]:
    named = (getattr(module, name) for name in sorted(module.__all__))
    return [m for m in named if inspect.isclass(m) and issubclass(m, Message) and hasattr(m, "ros_type")]


def _field_notes(model: type[Message]) -> dict[str, str]:
    """Return the texts that stand below the fields of a model in its source."""
    (body,) = ast.parse(inspect.getsource(model)).body
    if not isinstance(body, ast.ClassDef):
        raise TypeError(f"{model} is not a class")
    notes: dict[str, str] = {}
    for before, after in zip(body.body, body.body[1:], strict=False):
        if (
            isinstance(before, ast.AnnAssign)
            and isinstance(before.target, ast.Name)
            and isinstance(after, ast.Expr)
            and isinstance(after.value, ast.Constant)
        ):
            notes[before.target.id] = inspect.cleandoc(str(after.value.value))
    return notes


# Public API


_GROUP = re.compile(r"^(\w[\w ]*?) {2,}((?:`\w+`(?:,\s+)?)+)[^\n]*\n", re.MULTILINE)
"""A line of the package's docstring: a group and its names."""


def api() -> str:
    """Return the page on the package `trocar` in the groups of its docstring; mkdocstrings fills it."""
    about = inspect.getdoc(trocar) or ""
    groups = {name: re.findall(r"\w+", names) for name, names in _GROUP.findall(about)}
    grouped = {name for names in groups.values() for name in names}
    groups["Other names"] = [name for name in sorted(trocar.__all__) if name not in grouped]
    lines = ["# Python: the package `trocar`", "", _prose(_GROUP.sub("", about)), ""]
    for group, names in groups.items():
        if names:
            lines += [f"## {group}", ""]
        for name in names:
            lines += [f"::: trocar.{name}", "    options: {heading_level: 3}", ""]
    return "\n".join(lines)


def _summary(thing: Any) -> str:
    return (inspect.getdoc(thing) or "").partition("\n\n")[0]


def _prose(text: str | None) -> str:
    return inspect.cleandoc(text or "").replace("<", "&lt;")


def _cell(text: str) -> str:
    """Return a text as it may stand in a cell of a table."""
    flat = " ".join(text.split()).replace("|", "\\|")
    return re.sub(r"(`[^`]*`)|<", lambda found: found[1] or "&lt;", flat)
