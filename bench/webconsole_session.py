"""How fast a page's keys reach a session, and how soon a fork from a page is live.

python -m bench.webconsole_session [lead] [fork] [--seconds 10] [--output FILE]

`lead`: `browser` in real time with a page's server and a page without a browser, which presses and releases
the dead-man at random times; from sending it to the communication point at which it enters a grant, that is
until the sample is at the hub's machine plus the `age_ns` that the hub has recorded for it; then from a key
that moves to a frame in which a body is elsewhere, and from the last input of a page that falls silent with
the dead-man held to the sample that lets it go. `fork`:
`palpation` recorded for `--seconds`, verified, and forked at its end as a page does it, whose form was open
for 5 s; from the order to the page that is live, beside the time that the past takes at the real-time factor
of `verify` (from its first step to its last) and 1 s. The load stands beside.
"""

from __future__ import annotations

import argparse
import asyncio
import http.client
import json
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from time import monotonic_ns, perf_counter, sleep
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import zenoh
from numpy.typing import NDArray
from websockets.asyncio.client import ClientConnection, connect
from zenoh.handlers import Callback

from hub.recording.recording import Recording
from hub.remote.hub_connection import reach
from hub.security.credentials import OBSERVER
from hub.transport.hub_files import running_hubs
from schemas.codec import decode
from schemas.keys import Keys
from schemas.ros import Joy
from webconsole.commands import Fork
from webconsole.fork import fork_arguments, fork_modules
from webconsole.frame import SectionKind, sections
from webconsole.started import Started

PRESSES, MOVES, SILENCES = 200, 20, 10
MOVED_M = 1e-5
_LATEST_NS = 500_000_000
"""Between trials of one kind and of another."""
FORM_S = 5.0
"""A person has the form of the fork open for longer: meanwhile its processes become ready."""


def bench_lead(_seconds: float) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as place:
        recording, said = Path(place, "recorded"), Path(place, "said")
        command = [
            sys.executable,
            "-P",
            "-m",
            "trocar",
            "run",
            "browser",
            "--open",
            "--record",
            str(recording),
        ]
        with said.open("w") as out:
            run = subprocess.Popen(command, stdout=out, stderr=out, env=os.environ | {"BROWSER": "true"})
        try:
            while not (link := re.search(r"http://127\S+", said.read_text())):
                sleep(0.1)
            endpoint = next(one.endpoint for one in running_hubs() if one.pid == run.pid)
            arrived: list[tuple[int, bytes]] = []
            with reach(endpoint, OBSERVER) as session:
                key = Keys("browser").output("device", "right", "buttons")

                def take(sample: zenoh.Sample, arrived: list[tuple[int, bytes]] = arrived) -> None:
                    arrived.append((monotonic_ns(), sample.payload.to_bytes()))

                subscriber = session.declare_subscriber(key, Callback(take, indirect=False))
                sent, changed_ms, silent = asyncio.run(_press(link[0]))
                sleep(0.5)
                subscriber.undeclare()
        finally:
            run.send_signal(signal.SIGINT)
            run.wait()
        ages = [
            sample.age_ns
            for grant in Recording(recording).grants()
            for sample in grant.inlets
            if (sample.participant, sample.port) == ("right", "buttons") and sample.payload.size
        ]
    if len(arrived) != len(ages):
        return {"arrived": len(arrived), "granted": len(ages), "trouble": "some were lost"}
    held = [bool(decode(Joy, payload).buttons[0]) for _, payload in arrived]
    presses = _presses(sent, [*zip((time for time, _ in arrived), held, ages, strict=True)])
    took_ms = [1e-6 * took_ns for took_ns, _ in presses]
    ages = [age_ns for _, age_ns in presses]
    open_ns = [time for (time, _), pressed in zip(arrived, held, strict=True) if not pressed]
    held_ms = [1e-6 * (min(later) - last) for last in silent if (later := [t for t in open_ns if t > last])]
    return {
        "presses": len(sent),
        "of_them_merged_with_the_next": len(sent) - len(presses),
        "p50_ms": round(float(np.percentile(took_ms, 50)), 2),
        "p95_ms": round(float(np.percentile(took_ms, 95)), 2),
        "largest_ms": round(max(took_ms), 2),
        "of_it_waiting_for_the_grant_p50_ms": round(float(np.percentile(ages, 50)) / 1e6, 2),
        "key_to_changed_scene_p50_ms": round(float(np.percentile(changed_ms, 50)), 1),
        "key_to_changed_scene_p95_ms": round(float(np.percentile(changed_ms, 95)), 1),
        "silences": len(held_ms),
        "silence_to_hold_p50_ms": round(float(np.percentile(held_ms, 50)), 1),
        "silence_to_hold_largest_ms": round(max(held_ms), 1),
    }


def _presses(sent: list[int], arrived: list[tuple[int, bool, int]]) -> list[tuple[int, int]]:
    """Return of each press or release that entered a grant how long that took, and its age there (ns).

    `sent`: when each was sent, presses and releases in turn; `arrived`: when, whether pressed, and the age.
    The newest wins: two of them between two reads of the device leave no trace. So each that arrived is
    paired with the newest of its state that was sent before.
    """
    found: list[tuple[int, int]] = []
    for time_ns, pressed, age_ns in arrived:
        before = [at for at in sent[not pressed :: 2] if at < time_ns]
        if before and time_ns < sent[-1] + _LATEST_NS:
            found.append((time_ns - before[-1] + age_ns, age_ns))
    return found


async def _press(link: str) -> tuple[list[int], list[float], list[int]]:
    """Lead the hand.

    Return when each press and release was sent (ns), how long it took from a key that moves to a frame in
    which the tip is elsewhere (ms), and when the last input before each silence with the dead-man held was
    sent (ns).
    """
    url, draw = urlsplit(link), np.random.default_rng(0)
    connection = http.client.HTTPConnection(url.netloc)
    connection.request("GET", f"{url.path}?{url.query}")
    cookie = (connection.getresponse().getheader("Set-Cookie") or "").partition(";")[0]
    headers = {"Cookie": cookie, "Origin": f"http://{url.netloc}"}
    sent: list[int] = []
    async with connect(f"ws://{url.netloc}/page", additional_headers=headers, origin=None) as socket:
        await _led(socket)
        reading = asyncio.create_task(_read(socket))
        for number in range(PRESSES):
            await asyncio.sleep(draw.uniform(0.03, 0.06))  # less than the silence that lets go
            sent.append(monotonic_ns())
            await socket.send(json.dumps({"do": "hand", "number": number, "dead_man": number % 2 == 0}))
        reading.cancel()
        await asyncio.sleep(0.5)
        numbers = count(PRESSES)
        changed_ms = [await _moved(socket, numbers, 1 - 2 * (trial % 2)) for trial in range(MOVES)]
        reading = asyncio.create_task(_read(socket))
        silent = [await _silence(socket, numbers) for _ in range(SILENCES)]
        reading.cancel()
    return sent, changed_ms, silent


async def _hold(socket: ClientConnection, number: int, up: int, held: bool) -> None:
    order = {"do": "hand", "number": number, "linear": [0, 0, up], "dead_man": held}
    await socket.send(json.dumps(order))


async def _moved(socket: ClientConnection, numbers: Iterator[int], up: int) -> float:
    """Let go until the arm stands still, then hold a key until a frame shows that it moves; ms.

    On a busy machine a silence may let go meanwhile: then all begins anew.
    """
    still: NDArray[np.float32] | None = None
    end, due, begun = monotonic_ns() + _LATEST_NS, 0, 0
    while True:
        now = monotonic_ns()
        if begun and now > begun + _LATEST_NS:
            end, begun = now + _LATEST_NS, 0
        if now > end and not begun:
            begun = now
        if now >= due:
            due = now + 25_000_000
            await _hold(socket, next(numbers), up if begun else 0, bool(begun))
        message = await _next(socket)
        if not isinstance(message, bytes):
            continue
        number, _, parts = sections(message)
        await socket.send(struct.pack("<I", number))
        for part in parts:
            if part.kind is not SectionKind.POSES:
                continue
            places = np.frombuffer(part.content, "<f4", 3 * (len(part.content) // 20))
            if begun and still is not None and np.abs(places - still).max() > MOVED_M:
                await _hold(socket, next(numbers), 0, False)
                return (monotonic_ns() - begun) / 1e6
            if not begun:
                still = places


async def _next(socket: ClientConnection) -> str | bytes | None:
    """Return the next message; None if there is none for some milliseconds."""
    try:
        async with asyncio.timeout(0.005):
            return await socket.recv()
    except TimeoutError:
        return None


async def _silence(socket: ClientConnection, numbers: Iterator[int]) -> int:
    """Press the dead-man anew, then send nothing; return when the last input was sent (ns)."""
    last = 0
    for turn in range(8):
        last = monotonic_ns()
        await _hold(socket, next(numbers), 0, turn > 1)
        await asyncio.sleep(0.03)
    await asyncio.sleep(0.5)
    return last


async def _led(socket: ClientConnection) -> None:
    """Become the pilot, once the hand is offered."""
    while True:
        await socket.send(json.dumps({"do": "lead", "device": "right"}))
        async for message in socket:
            if isinstance(message, bytes):
                await _acknowledge(socket, message)
                continue
            answer: dict[str, Any] = json.loads(message)
            if answer.get("to") == "lead":
                if "error" not in answer:
                    return
                await asyncio.sleep(0.2)
                break


async def _read(socket: ClientConnection) -> None:
    async for message in socket:
        if isinstance(message, bytes):
            await _acknowledge(socket, message)


async def _acknowledge(socket: ClientConnection, message: bytes) -> None:
    await socket.send(struct.pack("<I", sections(message)[0]))


_FACTOR = """
import os, sys, time
from hub.hosting.numerics import pin_numerics
pin_numerics(os.environ)  # or the first state that differs ends it, before anything is pressed
from pathlib import Path
from hub.recording.recording import Recording
from hub.verify import verify
seen = []
verify(Recording(Path(sys.argv[1])), progress=lambda one: seen.append((time.perf_counter(), one.sim_time_s)))
(begun, first), (ended, last) = seen[0], seen[-1]
assert last > float(sys.argv[2]) - 0.1, last
print((last - first) / (ended - begun))
"""


def _output(*arguments: str) -> str:
    command = [sys.executable, "-P", *arguments]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def _trocar(*arguments: str) -> None:
    subprocess.run([sys.executable, "-P", "-m", "trocar", *arguments], check=True, stdout=subprocess.DEVNULL)


def bench_fork(seconds: float) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as place:
        directory = Path(place, "palpation")
        _trocar("run", "palpation", "--set", f"duration={seconds} s", "--record", str(directory))
        recording = Recording(directory)
        factor = json.loads(_output("-c", _FACTOR, str(directory), str(seconds)).splitlines()[-1])
        order = Fork(do="fork", time=seconds, duration=seconds + 600.0, pace="realtime", record=False)
        started = Started()
        started.prepare(fork_modules(recording.scenario()))  # the form is open
        sleep(FORM_S)
        begun = perf_counter()
        one = started.start("fork", fork_arguments(recording, order), seconds)
        while one.as_json()["state"] == "starting":
            sleep(0.01)
        live_s, state = perf_counter() - begun, one.as_json()
        started.close()
    return {
        "past_s": seconds,
        "verify_of_real_time": round(factor, 3),
        "state": state["state"],
        "error": state["error"],
        "live_after_s": round(live_s, 2),
        "to_reach_s": round(seconds / factor + 1.0, 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", default=["lead", "fork"])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--output", type=Path)
    options = parser.parse_args()
    result: dict[str, Any] = {"cores": os.cpu_count(), "load_before": os.getloadavg()}
    for part in options.parts:
        result[part] = {"lead": bench_lead, "fork": bench_fork}[part](options.seconds)
    result["load_after"] = os.getloadavg()
    text = json.dumps(result, indent=2)
    print(text)
    if options.output is not None:
        options.output.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
