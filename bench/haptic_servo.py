"""The servo process of the haptic styluses: jitter of its ticks, and how long a force outlives a fault.

The faults: its host is killed; the servo process itself is stopped; a call of the driver does not return.

    python bench/haptic_servo.py [--seconds 20] [--styluses 2] [--planes 4] [--stops 10] [--idle]

Styluses of the stand-in for HDAPI, all in contact, beside a device host that reads them at 1 kHz and sends
contact models at 250 Hz, and, unless `--idle`, one busy process on every core. Needs a C compiler.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from time import monotonic, sleep

import numpy as np

from tests.devices.standins import build, hd

HOST = Path(hd.__file__).parent / "host.py"
BURN = "while True: pass"


def measured(seconds: float, styluses: int, planes: int, folder: Path) -> None:
    """Run, kill, and print."""
    library = build.compile_library("hd.c", folder / "libHD.so")
    world = hd.HdWorld(library, folder / "world")
    environment = {**os.environ, hd.VARIABLE: str(world.file), "PYTHONPATH": str(Path(__file__).parents[1])}
    for device in world.devices:
        device.target[1] = 0.03  # HDAPI's y is up: above the floor
        device.buttons = 1
    host = subprocess.Popen(
        [sys.executable, str(HOST), str(library), str(planes), str(styluses)], env=environment
    )
    try:
        sleep(3.0)
        for device in world.devices:
            device.amplitude[0], device.amplitude[1], device.frequency = 0.01, 0.02, 1.0
            device.target[1] = 0.01
        start = monotonic()
        sleep(seconds)
        for device in world.devices:
            device.amplitude[:] = 0.0, 0.0, 0.0
            device.target[1] = -0.005
        sleep(1.0)  # at rest, with force on the hand
    finally:
        host.kill()
        killed = monotonic()
    sleep(0.5)
    for index, device in enumerate(world.devices[:styluses]):
        rows = world.rows(index, start)
        run, after = rows[rows[:, hd.Row.TIME] < killed], rows[rows[:, hd.Row.TIME] >= killed]
        print(f"{device.name.decode()}: {timing(run)}; {force(run, after, killed)}")


def stood_still(stops: int, planes: int, folder: Path) -> None:
    """Stop the servo process, or block a call of the driver, in turn, and print how long the force stays."""
    library = build.compile_library("hd.c", folder / "libHD.so")
    world = hd.HdWorld(library, folder / "still")
    environment = {**os.environ, hd.VARIABLE: str(world.file), "PYTHONPATH": str(Path(__file__).parents[1])}
    device = world.devices[0]
    times: dict[str, list[float]] = {"stopped": [], "blocked": []}
    host = subprocess.Popen([sys.executable, str(HOST), str(library), str(planes), "1"], env=environment)
    try:
        for stop in range(stops):
            how = ("stopped", "blocked")[stop % 2]
            while not device.owner or np.linalg.norm(world.motors(0)) < 1.2:
                for height in (0.03, -0.005):
                    device.buttons, device.target[1] = 1, height
                    sleep(0.7)
            servo, start = device.owner, monotonic()
            if how == "stopped":
                os.kill(servo, signal.SIGSTOP)
            else:
                device.blocked = 2
            times[how].append((world.release(0, servo) - start) * 1e3)
            device.blocked, device.motors[:] = 0, (0.0, 0.0, 0.0)
    finally:
        host.kill()
    for how, ms in times.items():
        if ms:
            print(f"{how}: no force after {min(ms):.0f} to {max(ms):.0f} ms, median {np.median(ms):.0f} ms")


def timing(rows: np.ndarray) -> str:
    callback, gap = rows[:, hd.Row.CALLBACK] * 1e6, rows[:, hd.Row.GAP]
    p50, p99 = np.percentile(callback, [50, 99])
    rate = (len(rows) - 1) / (rows[-1, hd.Row.TIME] - rows[0, hd.Row.TIME])
    late = np.mean(gap > 2e-3)
    calls = f"callback p50 {p50:.0f} us, p99 {p99:.0f} us, worst {callback.max():.0f} us"
    return f"{rate:.1f} Hz, {calls}, gaps over 2 ms {late:.2%}, longest {gap.max() * 1e3:.1f} ms"


def force(run: np.ndarray, after: np.ndarray, killed: float) -> str:
    size = np.linalg.norm(np.vstack([run, after])[:, hd.Row.FORCE], axis=1)
    pushing = after[np.linalg.norm(after[:, hd.Row.FORCE], axis=1) > 0.0]
    until = (pushing[-1, hd.Row.TIME] - killed) * 1e3 if len(pushing) else 0.0
    last = f"of {size[len(run) - 1]:.2f} N zero {until:.0f} ms after the host was killed"
    return f"force up to {size.max():.2f} N, largest step up {np.diff(size).max():.3f} N, {last}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--styluses", type=int, choices=(1, 2), default=2)
    parser.add_argument("--planes", type=int, default=4)
    parser.add_argument("--stops", type=int, default=10, help="of the servo process, with force on the hand")
    parser.add_argument("--idle", action="store_true")
    arguments = parser.parse_args()
    burning = (
        []
        if arguments.idle
        else [subprocess.Popen([sys.executable, "-c", BURN]) for _ in range(os.cpu_count() or 1)]
    )
    try:
        with tempfile.TemporaryDirectory() as folder:
            measured(arguments.seconds, arguments.styluses, arguments.planes, Path(folder))
            stood_still(arguments.stops, arguments.planes, Path(folder))
            print(f"load average {os.getloadavg()[0]:.1f}")
    finally:
        for process in burning:
            process.kill()


if __name__ == "__main__":
    main()
