"""What the page of `trocar view` costs: its server, its size, its frames, and to look an instant up.

python -m bench.webconsole [server] [page] [seek] [step] [--seconds 6] [--minutes 10] [--output FILE]

`server`: processor time of a server process whose source is fed with the whole cart at 60 Hz, an organ of
1024 nodes and two pictures of 320 x 288 at 30 Hz, for one page and for four, which acknowledge each frame;
feeding stands beside it, and how the values come from Zenoh to the process is not in it. `page`: bytes of
page and scene as they are sent, the time to the first picture, and frames per second in headless Chromium
with software OpenGL. `seek`: the time to look up robot, organ and wrench at random instants of a recording,
compared with a scan of the file. `step`: processor time of `palpation` at pace `fast` in one process, start
included, with and without what a page shows being subscribed to, in turns, and the
state hashes of both. The load of the machine stands beside.
"""

from __future__ import annotations

import argparse
import asyncio
import http.client
import json
import math
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from time import clock_gettime, monotonic, perf_counter, process_time, pthread_getcpuclockid, sleep
from typing import Any

import numpy as np
from numpy.typing import NDArray
from websockets.asyncio.client import connect

from hub.planning.scenario_file import load
from hub.recording.moments import Moments
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.session.launch import plan_of
from schemas.codec import encode
from schemas.keys import Keys, topic
from schemas.ports import Port
from schemas.ros import CompressedImage
from schemas.trocar_msgs import SoftBodyState
from schemas.vectors import VectorCodec
from webconsole.console import Console
from webconsole.frame import sections
from webconsole.listening import on_loopback
from webconsole.live import Live
from webconsole.pilot import Pilots
from webconsole.server import Server
from webconsole.source import Outlet, Value

NODES, PICTURE_BYTES = 1024, 14_000
"""Of an organ; of a JPEG of 320 x 288 of the endoscope."""
LONGEST_WAIT_S = 120.0
CHROMIUM = shutil.which("chromium") or ""


class Fed:
    """A source with the whole cart, an organ and two pictures, which change at their rates."""

    kind, generation, guided = "live", 1, None

    def __init__(self) -> None:
        file = load("teleop", [])
        self.scenario, (plan, _) = file.scenario, plan_of(file.scenario, file.params)
        self.params = file.params.__getitem__
        self.qpos = VectorCodec(plan.participants["robot"].port("qpos"))
        picture = {"causality": "output", "type": CompressedImage.ros_type, "variability": "event"}
        self.outlets = (
            Outlet("robot", self.qpos.port),
            Outlet("tissue", Port(name="liver/nodes", causality="output", type=SoftBodyState.ros_type)),
            *(Outlet("endoscope", Port(name=f"{eye}/image", **picture)) for eye in ("left", "right")),
        )
        self._nodes, self._faces = ring()
        self._jpeg = np.random.default_rng(0).integers(0, 255, PICTURE_BYTES).astype(np.uint8)
        self._values: dict[str, Value] = {}
        self.state: dict[str, Any] = {"session": "bench", "state": "running", "time": 0.0}
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._feed, daemon=True)
        self._thread.start()

    @property
    def core_s(self) -> float:
        """Processor time of feeding: in a session other processes and the threads of Zenoh do that."""
        assert self._thread.ident is not None
        return clock_gettime(pthread_getcpuclockid(self._thread.ident))

    def _feed(self) -> None:
        start = monotonic()
        for tick in count():
            at = round(tick * 1e9 / 60)
            self._values["robot.qpos"] = Value(at, self.qpos.encode(np.full(self.qpos.size, 1e-4 * tick), at))
            if tick % 2 == 0:
                nodes = self._nodes * np.float32(1.0 + 0.05 * np.sin(tick / 20))
                state = SoftBodyState(header={}, body="liver", nodes_m=nodes.ravel())
                self._values["tissue.liver/nodes"] = Value(at, encode(state))
                for eye in ("left", "right"):
                    image = CompressedImage(header={}, format="jpeg", data=self._jpeg)
                    self._values[f"endoscope.{eye}/image"] = Value(at, encode(image))
            self.state["time"] = at / 1e9
            if self._ending.wait(max(0.0, start + (tick + 1) / 60 - monotonic())):
                return

    def want(self, names: frozenset[str]) -> None:
        """All is fed."""

    def newest(self, name: str, time_ns: int | None) -> Value | None:
        """Return the newest value."""
        return self._values.get(name)

    def first(self, name: str) -> Value:
        """Return the organ with its surface."""
        faces = self._faces.ravel()
        return Value(
            0, encode(SoftBodyState(header={}, body="", nodes_m=self._nodes.ravel(), triangles=faces))
        )

    def close(self) -> None:
        """Feed no more."""
        self._ending.set()


def ring() -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Return nodes (m) and triangles of a ring of 84 mm, which are as many as the figures are for."""
    side = math.isqrt(NODES)
    around, across = (2.0 * np.pi * angle / side for angle in np.divmod(np.arange(NODES), side))
    reach = 0.03 + 0.012 * np.cos(across)
    nodes = np.column_stack([reach * np.cos(around), reach * np.sin(around), 0.012 * np.sin(across)])
    row, column = np.divmod(np.arange(NODES), side)
    right, up = side * ((row + 1) % side) + column, side * row + (column + 1) % side
    corner, opposite = side * row + column, side * ((row + 1) % side) + (column + 1) % side
    faces = np.vstack([np.column_stack([corner, right, opposite]), np.column_stack([corner, opposite, up])])
    return nodes.astype(np.float32), faces.astype(np.uint32)


def serve() -> None:
    """Serve the fed source in this process; say where, and at each line that comes the processor times."""
    source = Fed()
    server = Server(Console(source, Pilots()), on_loopback(0))  # pyright: ignore[reportArgumentType]
    thread = threading.Thread(target=server.run)
    thread.start()
    while not sys.stdin.closed and (asked := sys.stdin.readline()):
        times = process_time() - source.core_s, source.core_s
        answer = server.gate.invite("operator") if asked.strip() == "link" else times
        print(json.dumps([server.port, answer]), flush=True)
    server.stop()
    thread.join()


class Served:
    """The server in a process of its own."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def ask(self, what: str) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(what, file=self._process.stdin, flush=True)
        self.port, answer = json.loads(self._process.stdout.readline())
        return answer

    def cookie(self) -> str:
        """Return the cookie of one more browser."""
        link = self.ask("link")
        connection = http.client.HTTPConnection("127.0.0.1", self.port)
        connection.request("GET", link)
        return (connection.getresponse().getheader("Set-Cookie") or "").partition(";")[0]

    def size(self, path: str, cookie: str) -> int:
        """Return the bytes of a file as it is sent."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port)
        connection.request("GET", path, headers={"Cookie": cookie})
        return len(connection.getresponse().read())


@contextmanager
def served() -> Iterator[Served]:
    command = [sys.executable, "-m", "bench.webconsole", "--serve"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        yield Served(process)


async def _page(port: int, cookie: str, pictures: bool, seconds: float) -> tuple[int, int]:
    """Look for some time; return frames and bytes."""
    headers, frames, size = {"Cookie": cookie, "Origin": f"http://127.0.0.1:{port}"}, 0, 0
    async with connect(f"ws://127.0.0.1:{port}/page", additional_headers=headers, origin=None) as socket:
        await socket.send(json.dumps({"do": "show", "pictures": pictures}))
        end = monotonic() + seconds
        async for message in socket:
            if isinstance(message, bytes):
                frames, size = frames + 1, size + len(message)
                await socket.send(struct.pack("<I", sections(message)[0]))
            if monotonic() > end:
                break
    return frames, size


def bench_server(seconds: float) -> dict[str, Any]:
    rows: dict[str, Any] = {}
    with served() as server:
        cookies = [server.cookie() for _ in range(4)]
        asyncio.run(_page(server.port, cookies[0], True, 3.0))  # the model is built
        rows["no page"] = _shares(server, lambda: sleep(seconds / 2))
        for pages, pictures in ((1, True), (1, False), (4, True)):

            async def look(pages: int = pages, pictures: bool = pictures) -> list[tuple[int, int]]:
                each = [_page(server.port, cookie, pictures, seconds) for cookie in cookies[:pages]]
                return await asyncio.gather(*each)

            found: list[tuple[int, int]] = []
            shares = _shares(server, lambda look=look, found=found: found.extend(asyncio.run(look())))
            rows[f"{pages} pages, pictures {'on' if pictures else 'off'}"] = {
                **shares,
                "frames_per_s": round(sum(f for f, _ in found) / pages / seconds, 1),
                "mb_per_s_each": round(sum(b for _, b in found) / pages / seconds / 1e6, 3),
            }
    return rows


def _shares(server: Served, run: Any) -> dict[str, float]:
    """Return the processor time of the server, and of what feeds it, while something runs; % of a core."""
    before, begun = server.ask("time"), perf_counter()
    run()
    took = np.subtract(server.ask("time"), before) / (perf_counter() - begun)
    return dict(zip(("core_percent", "feed_percent"), (100.0 * took).round(1).tolist(), strict=True))


def bench_page(seconds: float) -> dict[str, Any]:
    from playwright.sync_api import sync_playwright

    with served() as server, sync_playwright() as driver:
        cookie = server.cookie()
        asyncio_run = threading.Thread(target=lambda: asyncio.run(_page(server.port, cookie, True, 3.0)))
        asyncio_run.start()
        asyncio_run.join()
        flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=flags)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        paths: list[str] = []
        page.on("request", lambda request: paths.append(request.url))
        link = f"http://127.0.0.1:{server.port}{server.ask('link')}"
        begun = perf_counter()
        page.goto(link)
        while not page.evaluate("Boolean(window.trocar?.scene?.placed)"):
            if perf_counter() - begun > LONGEST_WAIT_S:
                raise TimeoutError(f"no scene on the page after {LONGEST_WAIT_S:g} s")
            sleep(0.02)
        first_s = perf_counter() - begun
        sleep(2.0)
        drawn, begun = page.evaluate("trocar.drawn"), perf_counter()
        sleep(seconds)
        rate = (page.evaluate("trocar.drawn") - drawn) / (perf_counter() - begun)
        page.evaluate("trocar.scene.choose('robot')")
        drawn, begun = page.evaluate("trocar.drawn"), perf_counter()
        sleep(seconds)
        whole = (page.evaluate("trocar.drawn") - drawn) / (perf_counter() - begun)
        browser.close()
        own = {f"/{url.split('/', 3)[3]}" for url in paths if "token" not in url and url.startswith("http")}
        sizes = {path: server.size(path, cookie) for path in sorted(own)}
    return {
        "gzipped_kb": round(sum(sizes.values()) / 1e3, 1),
        "scene_kb": round(sizes.get("/scene", 0) / 1e3, 1),
        "first_picture_s": round(first_s, 2),
        "frames_per_s_at_the_work": round(rate, 1),
        "frames_per_s_whole_robot": round(whole, 1),
    }


def bench_seek(minutes: float) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as place:
        directory = Path(place, "long")
        steps = _record(directory, minutes)
        recording = Recording(directory)
        topics = [name for name in recording.topics if "/out/" in name]
        begun = perf_counter()
        moments = Moments(recording)
        instants = np.random.default_rng(0).integers(0, steps * 1_000_000, 100).tolist()
        took: list[float] = []
        found: list[dict[str, Any]] = []
        for instant in instants:
            start = perf_counter()
            found.append({name: moments.newest(name, instant) for name in topics})
            took.append(perf_counter() - start)
        newest: list[dict[str, Any]] = [{} for _ in instants]
        for message in recording.messages(*topics):
            for row, instant in zip(newest, instants, strict=True):
                if message.time_ns <= instant:
                    row[message.topic] = message
        same = sum({k: row.get(k) for k in topics} == one for row, one in zip(newest, found, strict=True))
        return {
            "minutes": minutes,
            "file_mb": round(recording.file.stat().st_size / 1e6, 1),
            "p50_ms": round(1e3 * float(np.percentile(took, 50)), 2),
            "p95_ms": round(1e3 * float(np.percentile(took, 95)), 2),
            "equal_to_a_scan": f"{same} of {len(instants)}",
            "all_s": round(perf_counter() - begun, 1),
        }


def bench_step(seconds: float) -> dict[str, Any]:
    alone: list[float] = []
    seen: list[float] = []
    values: list[int] = []
    hashes: set[str] = set()
    for _ in range(3):
        for taken, look in ((alone, False), (seen, True)):
            core_s, state_hash, received = _run(seconds, look=look)
            taken.append(core_s)
            hashes.add(state_hash)
            values += [received] if look else []
    return {
        "core_s_alone": [round(one, 2) for one in alone],
        "core_s_seen": [round(one, 2) for one in seen],
        "least_seen_of_least_alone": round(min(seen) / min(alone), 3),
        "values_received": values,
        "state_hashes": len(hashes),
    }


def _run(seconds: float, *, look: bool) -> tuple[float, str, int]:
    """Run a session; return its processor time with its start, state hash, and values that were received."""
    code = (
        "import json, time; from hub.planning.scenario_file import load;"
        "from hub.session.launch import launch;"
        f"session = launch(load('palpation', ['duration={seconds} s']), one_host=True);"
        "summary = session.run(); print(json.dumps([time.process_time(), summary.state_hash]))"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        live, received = Live(pid=process.pid), 0
        if look:
            live.start()
            last: dict[str, Value | None] = {}
            names = frozenset(("robot.qpos", "tissue.block/nodes", "tissue.probe/wrench"))
            while process.poll() is None:
                if live.generation:
                    live.want(names)
                now = {name: live.newest(name, None) for name in names}
                received += sum(now[name] is not last.get(name) for name in names)
                last = now
                sleep(0.005)
        assert process.stdout is not None
        core_s, state_hash = json.loads(process.stdout.read())
        live.close()
    return core_s, state_hash, received


def _record(directory: Path, minutes: float) -> int:
    """Record robot and wrench at 1 kHz and 200 Hz, and an organ at 60 Hz; return the steps of 1 ms."""
    file = load("palpation", [])
    plan, _ = plan_of(file.scenario, file.params)
    keys, steps = Keys("palpation"), round(60_000 * minutes)
    qpos = VectorCodec(plan.participants["robot"].port("qpos"))
    wrench = VectorCodec(plan.participants["tissue"].port("probe/wrench"))
    attachments = {
        "scenario.json": file.scenario.model_dump_json().encode(),
        "plan.json": plan.model_dump_json().encode(),
    }
    nodes = np.random.default_rng(0).normal(size=750).astype(np.float32)
    with Recorder(directory, attachments=attachments) as recorder:
        robot = recorder.add_channel(topic(keys.output("engine", "robot", "qpos")), qpos.port.type)
        force = recorder.add_channel(topic(keys.output("engine", "tissue", "probe/wrench")), wrench.port.type)
        organ = recorder.add_channel(
            topic(keys.output("engine", "tissue", "block/nodes")), SoftBodyState.ros_type
        )
        for step in range(steps):
            at = step * 1_000_000
            recorder.write(force, at, wrench.encode(np.full(6, 1e-3 * step), at))
            if step % 5 == 0:
                recorder.write(robot, at, qpos.encode(np.full(qpos.size, 1e-4 * step), at))
            if step % 16 == 0:
                recorder.write(
                    organ, at, encode(SoftBodyState(header={}, body="block", nodes_m=nodes + step))
                )
            if step % 20_000 == 0:
                sleep(0.5)  # the disk is behind
    return steps


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", default=["server", "page", "seek", "step"])
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--output", type=Path)
    parser.add_argument("--serve", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve()
        return
    result: dict[str, Any] = {"cores": os.cpu_count(), "load_before": os.getloadavg()}
    for part in options.parts:
        run = {"server": bench_server, "page": bench_page, "seek": bench_seek, "step": bench_step}[part]
        result[part] = run(options.minutes if part == "seek" else options.seconds)
    result["load_after"] = os.getloadavg()
    text = json.dumps(result, indent=2)
    print(text)
    if options.output is not None:
        options.output.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
