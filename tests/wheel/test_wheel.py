"""The built wheel in clean environments: without extras, with all of them, beside another distribution."""

import hashlib
import importlib.metadata
import json
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from base64 import urlsafe_b64encode
from pathlib import Path
from typing import Any

import pytest

from hub.import_names import NAMES
from tests.devices.standins import build as standins
from tests.hub.authorities import free_port
from tests.wheel.environments import CLEAN, bare, install, run, succeed, with_our_packages

pytestmark = [
    pytest.mark.release,
    pytest.mark.xdist_group("wheel"),  # its fixtures are expensive: made once, in one process
    pytest.mark.timeout(600),  # they fetch packages
]

ROOT = Path(__file__).resolve().parents[2]
IMPORT_NAMES = "from hub import doctor; print(doctor.as_json([*doctor._check_import_names()]))"
"""Prints what `trocar doctor` finds of the import names, without the rest, which takes seconds."""


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the source distribution."""
    out = tmp_path_factory.mktemp("dist")
    succeed(sys.executable, "-m", "build", "--outdir", out, ROOT, cwd=out)
    return next(out.glob("*.whl"))


@pytest.fixture(scope="session")
def base(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Trocar and what it depends on, from the index; nothing of an extra (that of `touch` is empty)."""
    there = bare(tmp_path_factory.mktemp("base") / "venv")
    install(there, f"{wheel}[touch]")
    return there


@pytest.fixture(scope="session")
def full(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Trocar from the wheel, with the packages of all extras as they are installed here."""
    there = with_our_packages(tmp_path_factory.mktemp("full") / "venv")
    install(there, "--no-deps", wheel)
    return there


@pytest.fixture(scope="module")
def findings(base: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, Any]]:
    """What `trocar doctor` finds without extras."""
    said = succeed(base / "trocar", "doctor", "--json", cwd=tmp_path_factory.mktemp("doctor"))
    return json.loads(said)["findings"]


@pytest.fixture
def stray(tmp_path: Path) -> Path:
    """A directory with modules whose names are those of our packages."""
    for name in NAMES:
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the stray module was imported')\n")
    return tmp_path


def test_it_holds_the_packages_and_the_scenarios_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {*NAMES}
    assert {
        "configs/palpation.yaml",
        "configs/scenario.schema.json",
        "configs/data/palpation_hand/palpation_hand.mcap",
    } <= set(names)


def test_what_is_in_c_is_compiled_where_there_is_a_compiler(wheel, tmp_path):
    held = [Path(name) for name in zipfile.ZipFile(wheel).namelist()]
    for compiled in ("robots/_kinematics.*.so", "schemas/_cdr.*.so", "engines/fmu/_calls.*.so"):
        assert any(path.match(compiled) for path in held), compiled
    build = [sys.executable, "-m", "build", "--wheel", "--outdir", tmp_path / "dist", "sources"]
    with tarfile.open(next(wheel.parent.glob("*.tar.gz"))) as sources:
        sources.extractall(tmp_path, filter="data")
        (tmp_path / sources.getnames()[0].partition("/")[0]).rename(tmp_path / "sources")
    lacking = {**CLEAN, "CC": str(tmp_path / "no-compiler")}
    done = subprocess.run(build, cwd=tmp_path, env=lacking, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert [path.name.endswith("-py3-none-any.whl") for path in (tmp_path / "dist").iterdir()] == [True]


def test_without_extras_the_command_line_works(base, findings, tmp_path):
    assert "Exit codes" in succeed(base / "trocar", "--help", cwd=tmp_path)
    assert succeed(base / "trocar", "--version", cwd=tmp_path).strip() == importlib.metadata.version("trocar")
    found = {f["name"]: f for f in findings if f["area"] != "engine"}
    assert found["Zenoh"]["works"]
    assert not found["mujoco"]["works"]
    assert found["mujoco"]["remedy"] == "pip install 'trocar[mujoco]'"


def test_without_extras_every_kind_can_be_described(base, findings, tmp_path):
    found = {
        f["name"]
        for f in findings
        if f["area"] in ("engine", "controller", "device") and f["detail"] == "from trocar"
    }
    entries = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    assert found == {
        name
        for group in ("trocar.engines", "trocar.controllers", "trocar.devices")
        for name in entries[group]
    }
    assert (
        succeed(base / "trocar", "schema", cwd=tmp_path)
        == (ROOT / "configs" / "scenario.schema.json").read_text()
    )


def test_without_extras_a_scenario_says_what_to_install(base, tmp_path):
    done = run(base / "trocar", "run", "palpation", cwd=tmp_path)
    assert done.returncode == 2
    assert "palpation.yaml:" in done.stderr
    assert "pip install 'trocar[mujoco]'" in done.stderr
    assert "pip install 'trocar[bullet]'" in done.stderr


def test_with_all_extras_a_stray_module_in_the_working_directory_is_not_imported(full, stray):
    succeed(full / "trocar", "check", "palpation", cwd=stray)
    succeed(full / "python", "-P", "-m", "hub.command_line", "check", "palpation", cwd=stray)
    summary = json.loads(
        succeed(
            full / "trocar",
            "run",
            "palpation",
            "--set",
            "duration=20 ms",
            "--record",
            "recording",
            "--json",
            cwd=stray,
        )
    )
    assert summary["steps"] == 20
    succeed(full / "trocar", "verify", "recording", cwd=stray)


def test_a_device_host_pulls_no_simulator(base, tmp_path):
    names = succeed(
        base / "python",
        "-c",
        "import importlib.metadata as m; print(*(d.name for d in m.distributions()))",
        cwd=tmp_path,
    ).split()
    assert "trocar" in names
    requirements = importlib.metadata.requires("trocar") or []
    assert not [requirement for requirement in requirements if 'extra == "touch"' in requirement]
    assert not {
        "mujoco",
        "manifold3d",
        "pybullet",
        "pybullet-arm64",
        "fmpy",
        "ruckig",
        "matplotlib",
        "pyopenxr",
        "pygame-ce",
        "pandas",
        "cryptography",
    } & {*names}


@pytest.mark.skipif(not standins.USABLE, reason=standins.WHY_NOT)
def test_a_device_host_joins_a_simulation_with_nothing_but_its_extra_and_its_certificate(
    full, base, tmp_path
):
    library = standins.compile_library("hd.c", tmp_path / "libHD.so")
    certificates, carried, endpoint = tmp_path / "certs", tmp_path / "carried", f"tls/127.0.0.1:{free_port()}"
    succeed(full / "trocar", "certs", "init", "127.0.0.1", "--dir", certificates, cwd=tmp_path)
    succeed(full / "trocar", "certs", "issue", "stylus", "--dir", certificates, cwd=tmp_path)
    carried.mkdir()
    (certificates / "stylus.pem").rename(carried / "stylus.pem")
    changes = {"kind": "touch", "host": "remote", "library": library, "styluses": "{right: {}}"}
    overrides = [
        word for name, value in changes.items() for word in ("--set", f"participants.stylus.{name}={value}")
    ]
    run = [
        full / "trocar",
        "run",
        "table",
        *overrides,
        "--set",
        "duration=5 s",
        "--pace",
        "realtime",
        "--listen",
        endpoint,
        "--certs",
        certificates,
        "--json",
    ]
    with subprocess.Popen(
        run, cwd=tmp_path, env=CLEAN, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as hub:
        joined: list[subprocess.Popen[str]] = []
        try:
            for line in hub.stderr:
                if "waiting for" in line and not joined:
                    join = [
                        base / "trocar",
                        "device",
                        "stylus",
                        "--connect",
                        endpoint,
                        "--certs",
                        carried,
                    ]
                    joined.append(
                        subprocess.Popen(join, cwd=tmp_path, env=CLEAN, stderr=subprocess.PIPE, text=True)
                    )
            summary = json.loads(hub.stdout.read())
        finally:
            hub.kill()
            for host in joined:
                host.terminate()
                errors = host.communicate()[1]
    assert summary["latency"]["device to grant"]["stylus.right/pose"]["count"] > 100, errors


def other_distribution(directory: Path) -> Path:
    """Return a wheel of another distribution that has the import names `devices` and `schemas`."""
    wheel = directory / "gadgets-2.0-py3-none-any.whl"
    info = "gadgets-2.0.dist-info"
    content = {
        "devices/__init__.py": "GADGETS = 7\n",
        "devices/lamp.py": "",
        "schemas.py": "",
        f"{info}/METADATA": "Metadata-Version: 2.1\nName: gadgets\nVersion: 2.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in content.items():
            archive.writestr(name, text)
        digests = {
            name: urlsafe_b64encode(hashlib.sha256(text.encode()).digest()).rstrip(b"=").decode()
            for name, text in content.items()
        }
        rows = [f"{name},sha256={digest}," for name, digest in digests.items()]
        archive.writestr(f"{info}/RECORD", "\n".join([*rows, f"{info}/RECORD,,", ""]))
    return wheel


def test_another_distribution_with_our_import_names_is_reported(wheel, tmp_path):
    there = with_our_packages(tmp_path / "venv")
    install(there, "--no-deps", wheel)
    install(there, "--no-deps", other_distribution(tmp_path))

    def found() -> dict[str, dict[str, str]]:
        said = succeed(there / "python", "-P", "-c", IMPORT_NAMES, cwd=tmp_path)
        return {f["name"]: f for f in json.loads(said)["findings"]}

    before = found()
    overwritten, beside = before.pop("import devices"), before.pop("import schemas")
    assert not before
    assert "'devices' is also brought by gadgets" in overwritten["detail"]
    assert "devices/__init__.py, which is of gadgets" in overwritten["detail"]
    assert overwritten["needed"]
    remedy = "pip uninstall gadgets, then pip install --force-reinstall --no-deps trocar"
    assert remedy in overwritten["remedy"]
    assert "schemas/__init__.py, which is of trocar" in beside["detail"]  # a package goes before a module
    assert not beside["needed"]

    install(there, "--no-deps", "--force-reinstall", wheel)
    assert "devices/__init__.py, which is of trocar" in found()["import devices"]["detail"]


def test_a_folder_on_the_path_with_our_import_names_is_reported(full, tmp_path):
    (tmp_path / "robots.py").write_text("")
    script = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{IMPORT_NAMES}"
    out = succeed(full / "python", "-P", "-c", script, cwd=tmp_path)
    (finding,) = json.loads(out)["findings"]
    imported = f"Python imports {tmp_path}/robots.py, which is of no distribution"
    assert finding["detail"] == f"'robots' is also on the import path; {imported}"
    assert not json.loads(out)["works"]


def test_the_import_names_are_those_of_the_project():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]
    assert {*project["hatch"]["build"]["targets"]["wheel"]["packages"]} == {*NAMES}
    assert {*project["importlinter"]["root_packages"]} == {*project["pyright"]["include"]} == {*NAMES}
