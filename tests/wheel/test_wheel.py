"""The built wheel in clean virtual environments: without extras, and with all of them."""

import json
import os
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

from tests.devices.standins import build as standins
from tests.hub.authorities import free_port

ROOT = Path(__file__).resolve().parents[2]
CLEAN = {
    key: value
    for key, value in os.environ.items()
    if key not in {"PYTHONPATH", "PYTHONSAFEPATH", "VIRTUAL_ENV"}
}


def run(*command: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(part) for part in command],
        cwd=cwd,
        env=CLEAN,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )


def succeed(*command: str | Path, cwd: Path) -> str:
    done = run(*command, cwd=cwd)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="session")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built from the source distribution."""
    out = tmp_path_factory.mktemp("dist")
    succeed(sys.executable, "-m", "build", "--outdir", out, ROOT, cwd=out)
    return next(out.glob("*.whl"))


def install(target: str, directory: Path) -> Path:
    """Return the `bin` of a new virtual environment with `target` installed in it."""
    succeed(sys.executable, "-m", "venv", "--without-pip", directory, cwd=directory.parent)
    succeed(
        sys.executable,
        "-m",
        "pip",
        "--python",
        directory / "bin" / "python",
        "install",
        "--quiet",
        target,
        cwd=directory.parent,
    )
    return directory / "bin"


@pytest.fixture(scope="session")
def base(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return install(str(wheel), tmp_path_factory.mktemp("base") / "venv")


@pytest.fixture(scope="session")
def full(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return install(f"{wheel}[all]", tmp_path_factory.mktemp("full") / "venv")


@pytest.fixture(scope="session")
def device_host(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return install(f"{wheel}[touch]", tmp_path_factory.mktemp("device_host") / "venv")


@pytest.fixture
def stray(tmp_path: Path) -> Path:
    """A directory with modules whose names are those of our packages."""
    for name in ("schemas", "robots", "hub", "engines", "controllers", "devices", "configs"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the stray module was imported')\n")
    return tmp_path


def test_it_holds_the_packages_and_the_scenarios_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {
        "schemas",
        "robots",
        "hub",
        "engines",
        "controllers",
        "devices",
        "configs",
    }
    assert {
        "configs/palpation.yaml",
        "configs/scenario.schema.json",
        "configs/data/palpation_hand/palpation_hand.mcap",
    } <= set(names)


def test_without_extras_the_command_line_works(base, tmp_path):
    assert "Exit codes" in succeed(base / "trocar", "--help", cwd=tmp_path)
    assert succeed(base / "trocar", "--version", cwd=tmp_path).strip() == version("trocar")
    findings = {
        f["name"]: f
        for f in json.loads(succeed(base / "trocar", "doctor", "--json", cwd=tmp_path))["findings"]
        if f["area"] != "engine"
    }
    assert findings["Zenoh"]["works"]
    assert not findings["mujoco"]["works"]
    assert findings["mujoco"]["remedy"] == "pip install 'trocar[mujoco]'"


def test_without_extras_every_kind_can_be_described(base, tmp_path):
    findings = json.loads(succeed(base / "trocar", "doctor", "--json", cwd=tmp_path))["findings"]
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


def test_a_device_host_pulls_no_simulator(device_host, tmp_path):
    names = succeed(
        device_host / "python",
        "-c",
        "import importlib.metadata as m; print(*(d.name for d in m.distributions()))",
        cwd=tmp_path,
    ).split()
    assert "trocar" in names
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
        "cryptography",
    } & {*names}


@pytest.mark.skipif(not standins.USABLE, reason=standins.WHY_NOT)
def test_a_device_host_joins_a_simulation_with_nothing_but_its_extra_and_its_certificate(
    full, device_host, tmp_path
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
        "duration=3 s",
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
                        device_host / "trocar",
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
                told = host.communicate()[1]
    assert summary["latency"]["device to grant"]["stylus.right/pose"]["count"] > 100, told
