"""Working parts of this machine, and remedies for all others."""

from __future__ import annotations

import json
import platform
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import distribution, entry_points
from importlib.util import find_spec

from hub.import_names import NAMES, import_collisions
from hub.planning import registry
from hub.planning.scenario_file import installed_scenarios
from hub.planning.scenario_source import read
from hub.security import credentials
from hub.transport.loopback_port import LoopbackPort
from hub.transport.session_secret import listen_with_secret, secret_of
from hub.transport.zenoh_session import open_session
from schemas.errors import TrocarError

__all__ = ["Finding", "as_json", "blocked_scenarios", "examine"]


@dataclass(frozen=True)
class Finding:
    """A checked part. `remedy`: the repairing line for a broken part."""

    area: str
    name: str
    works: bool
    detail: str
    remedy: str = ""
    needed: bool = False
    """Whether nothing runs without the part."""


_ROS = (
    ("ROS 2", "rclpy", "source the setup.bash of a ROS 2 installation before starting trocar"),
    (
        "ROS 1",
        "rospy",
        "apt-get install python3-rospy, and let this environment see /usr/lib/python3/dist-packages",
    ),
)


def examine() -> list[Finding]:
    """Check Python, Zenoh, import names, certificates, extras, kinds, the checks of packages, and ROS.

    Starts no device.
    """
    sections: tuple[Callable[[], Iterator[Finding]], ...] = (
        _check_python,
        _check_import_names,
        _check_zenoh,
        _check_certificates,
        _check_extras,
        _check_kinds,
        _run_package_checks,
        _check_ros,
    )
    return [finding for section in sections for finding in section()]


def blocked_scenarios() -> dict[str, str]:
    """Return the installed scenarios that cannot run here, each with the first reason."""
    blocked: dict[str, str] = {}
    for name, file in installed_scenarios().items():
        for spec in read(file).tree["participants"].values():
            try:
                registry.require_extra(spec["kind"])
            except TrocarError as error:
                blocked[name] = str(error)
                break
    return blocked


def _check_python() -> Iterator[Finding]:
    version = platform.python_version()
    yield Finding(
        "base",
        "Python",
        sys.version_info >= (3, 11),
        f"{version} on {platform.platform()}",
        "install Python 3.11 or newer",
        needed=True,
    )


def _check_import_names() -> Iterator[Finding]:
    """Check for foreign distributions with modules of our names, hiding or overwriting ours."""
    found = import_collisions()
    if not found:
        yield Finding("base", "import names", True, f"{', '.join(NAMES)} are Trocar's alone", needed=True)
    for one in found:
        brought = f"also brought by {', '.join(one.others)}" if one.others else "also on the import path"
        yield Finding(
            "base",
            f"import {one.name}",
            False,
            f"'{one.name}' is {brought}; Python imports {one.file}, which is of"
            f" {one.owner or 'no distribution'}",
            "python -m venv trocar-env, and install trocar there alone"
            + (f"; or pip uninstall {' '.join(one.others)}" if one.others else "")
            + ", then pip install --force-reinstall --no-deps trocar",
            needed=one.owner != "trocar",
        )


def _check_zenoh() -> Iterator[Finding]:
    """Open and join a router on loopback, as a session does."""
    try:
        port = LoopbackPort("tcp/127.0.0.1:0")
        with (
            listen_with_secret(port),
            open_session("client", connect=[port.endpoint], security=secret_of(port.endpoint)),
        ):
            pass
    except TrocarError as error:
        yield Finding(
            "base",
            "Zenoh",
            False,
            f"no session over loopback: {error}",
            "allow TCP connections to 127.0.0.1",
            needed=True,
        )
    else:
        yield Finding(
            "base",
            "Zenoh",
            True,
            f"eclipse-zenoh {distribution('eclipse-zenoh').version}, session over loopback",
            needed=True,
        )


def _check_certificates() -> Iterator[Finding]:
    """Check the certificates of this user for remote machines."""
    directory = credentials.default_directory()
    files = [file for file in sorted(directory.glob("*.pem")) if file.name != "ca.pem"]
    if not files:
        remedy = (
            "trocar certs init, where the hub runs; elsewhere, a copy of what trocar certs issue NAME makes"
            " there"
        )
        yield Finding(
            "network",
            "certificates",
            False,
            f"none in {directory}: a hub or a device on this machine cannot meet other machines",
            remedy,
        )
    for file in files:
        try:
            certificate = credentials.examine(credentials.load(file.stem, directory))
        except TrocarError as error:
            yield Finding(
                "network",
                file.stem,
                False,
                str(error),
                f"trocar certs {'renew' if file.stem == credentials.HUB else f'issue {file.stem}'}",
            )
        else:
            yield Finding(
                "network",
                file.stem,
                True,
                f"certificate in {directory}, valid until {certificate.until:%Y-%m-%d %H:%M} UTC",
            )


def _check_extras() -> Iterator[Finding]:
    trocar = distribution("trocar")
    for extra in sorted(trocar.metadata.get_all("Provides-Extra") or []):
        missing = registry.missing_packages(trocar, extra)
        detail = (
            f"not installed: {', '.join(missing)}"
            if missing
            else ", ".join(registry.installed_packages(trocar, extra))
        )
        yield Finding("extra", extra, not missing, detail, f"pip install 'trocar[{extra}]'")


def _check_kinds() -> Iterator[Finding]:
    broken = registry.broken_kinds()
    for name, kind in sorted(registry.kinds().items()):
        yield Finding(
            kind.role,
            name,
            name not in broken,
            broken.get(name, f"from {kind.distribution}"),
            f"pip install --force-reinstall {kind.distribution}",
        )


def _run_package_checks() -> Iterator[Finding]:
    """Run the checks of packages in the entry-point group `trocar.checks`."""
    for entry in sorted(entry_points(group="trocar.checks"), key=lambda e: e.name):
        try:
            yield Finding("machine", entry.name, *entry.load()())
        except Exception as error:  # noqa: BLE001 - whatever a package's check does, the others go on
            yield Finding(
                "machine",
                entry.name,
                False,
                f"{entry.value} failed: {type(error).__name__}: {error}",
                f"report it to the makers of {entry.value}",
            )


def _check_ros() -> Iterator[Finding]:
    for name, module, remedy in _ROS:
        found = find_spec(module)
        yield Finding(
            "ROS",
            name,
            found is not None,
            f"{module} {'can be imported' if found else 'cannot be imported'}",
            remedy,
        )


def as_json(findings: list[Finding]) -> str:
    """Return JSON: `works`, true if everything needed works, and the list `findings`."""
    return json.dumps(
        {"works": all(f.works for f in findings if f.needed), "findings": [vars(f) for f in findings]},
        indent=2,
    )
