"""The public names: exactly these, each documented; examples and documents use no others."""

import ast
import inspect
import pkgutil
import re
import subprocess
import sys
from pathlib import Path

import pytest

import trocar
import trocar.messages
import trocar.quantities
import trocar.records
import trocar.sessions
import trocar.tasks
from schemas.message import Message

ROOT = Path(__file__).resolve().parents[2]
PRIVATE = {
    "schemas",
    "anatomy",
    "robots",
    "hub",
    "engines",
    "controllers",
    "devices",
    "configs",
    "tasks",
    "webconsole",
}
PUBLIC = [
    "BondPlan",
    "BondSide",
    "Controller",
    "Device",
    "ForceSide",
    "Inputs",
    "MotionSide",
    "Outputs",
    "Params",
    "Port",
    "Reading",
    "Recording",
    "Sample",
    "Series",
    "Setup",
    "Stepped",
    "SteppedSession",
    "Summary",
    "TrocarError",
    "Value",
    "VerifySummary",
    "chain",
    "check_device",
    "check_engine",
    "connect",
    "event_in",
    "event_out",
    "fork",
    "inverse",
    "load_scenario",
    "recover",
    "restore_arrays",
    "run",
    "run_in_process",
    "signal_in",
    "signal_out",
    "state_hash",
    "verify",
    "write_bag",
]
TYPE_ALIASES = {"Outputs", "Value"}  # a text beside them says what they are; Python keeps none for an alias


def private_imports(source: str) -> set[str]:
    """Return the private modules that Python code imports."""
    modules = set[str]()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            modules.add(node.module)
    return {module for module in modules if module.split(".")[0] in PRIVATE}


def test_the_public_names_are_these() -> None:
    assert trocar.__all__ == PUBLIC
    assert sorted(trocar._ORIGINS) == PUBLIC
    assert dir(trocar) == PUBLIC
    assert {module.name for module in pkgutil.iter_modules(trocar.__path__)} == {
        "__main__",
        "environments",
        "haptics",
        "messages",
        "policies",
        "programs",
        "quantities",
        "records",
        "sessions",
        "tasks",
        "testing",
    }


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_is_documented(name: str) -> None:
    value = getattr(trocar, name)
    if name not in TYPE_ALIASES:
        assert len(inspect.getdoc(value) or "") > 15
        assert not (inspect.getdoc(value) or "").startswith(f"{name}(")  # what dataclasses write
    assert f"`{name}`" in (trocar.__doc__ or "")


def test_the_type_checker_sees_the_same_names() -> None:
    tree = ast.parse(Path(trocar.__file__).read_text())
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    found = {
        a.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for a in node.names
    }
    assert found == trocar._ORIGINS


def test_a_name_that_is_not_public() -> None:
    with pytest.raises(AttributeError, match=r"'trocar' has no public name 'Session'; it has .*Stepped"):
        _ = trocar.Session  # pyright: ignore[reportAttributeAccessIssue]


def test_importing_it_imports_nothing_heavy() -> None:
    script = "import sys, trocar; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=True)
    imported = {name.split(".")[0] for name in done.stdout.split()}
    assert not {"numpy", "zenoh", "pydantic", "hub", "pandas"} & imported


def test_a_plug_in_imports_no_simulator() -> None:
    script = "import sys; from trocar import Stepped, Device, run, check_engine; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=True)
    imported = {name.split(".")[0] for name in done.stdout.split()}
    assert not {"mujoco", "pybullet", "fmpy", "matplotlib", "pandas", "engines", "devices"} & imported


def test_the_messages_are_all_there_once() -> None:
    names = trocar.messages.__all__
    assert len({*names}) == len(names)
    assert {"JointState", "PoseStamped", "OperatingState", "SoftBodyState"} <= {*names}
    for name in names:
        assert issubclass(getattr(trocar.messages, name), Message)


@pytest.mark.long
def test_the_module_is_the_command_line(tmp_path: Path) -> None:
    command = [sys.executable, "-P", "-m", "trocar", "--help"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "Exit codes" in done.stdout


@pytest.mark.parametrize("file", sorted((ROOT / "examples").rglob("*.py")), ids=lambda file: file.name)
def test_examples_use_public_names_only(file: Path) -> None:
    assert private_imports(file.read_text()) == set()


@pytest.mark.parametrize(
    "file", [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))], ids=lambda file: file.name
)
def test_documents_use_public_names_only(file: Path) -> None:
    for block in re.findall(r"```python\n(.*?)```", file.read_text(), re.DOTALL):
        assert private_imports(block) == set()
