"""What viser costs for the load of `bench.webconsole`, on the same machine: for ratios in one run.

    python -m venv /tmp/viser && /tmp/viser/bin/pip install viser websockets
    python -m bench.webconsole_viser /tmp/viser/bin/python [--seconds 6]

The bodies of the whole cart at 60 Hz, and at 30 Hz, an organ of 1024 nodes and two pictures of 320 x 288 at
30 Hz, for one page that reads all. viser encodes the pictures itself. Processor time is that of viser's
process, which sets its handles too; frames per second are those in which Chromium draws with software OpenGL.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from time import monotonic, perf_counter, process_time, sleep
from typing import Any

import numpy as np

COUNT_DRAWN = """
window.drawn = 0; let drew = false;
const draw = WebGL2RenderingContext.prototype.drawElements;
WebGL2RenderingContext.prototype.drawElements = function (...given) { drew = true; draw.apply(this, given); };
const count = () => { if (drew) window.drawn++; drew = false; requestAnimationFrame(count); };
requestAnimationFrame(count);
"""
"""Counts the pictures in which something was drawn."""


def serve(load: Path, rate: int) -> None:
    """Serve the load with viser in this process; say the processor time at each line that comes."""
    import viser

    answers, sys.stdout = sys.stdout, sys.stderr  # viser prints too
    given = np.load(load)
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    bodies = [
        server.scene.add_mesh_simple(f"/body/{i}", given[f"vertices{i}"], given[f"faces{i}"])
        for i in range(int(given["bodies"]))
    ]
    organ = server.scene.add_mesh_simple("/organ", given["nodes"], given["triangles"])
    picture = np.random.default_rng(0).integers(0, 255, (36, 40, 3)).astype(np.uint8)
    picture = picture.repeat(8, axis=0).repeat(8, axis=1)
    eyes = [server.gui.add_image(picture, label=eye, format="jpeg") for eye in ("left", "right")]
    ended = threading.Event()

    def feed() -> None:
        start, tick = monotonic(), 0
        while not ended.wait(max(0.0, start + tick / rate - monotonic())):
            with server.atomic():
                for body in bodies:
                    body.position, body.wxyz = (1e-4 * tick, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
                if tick % (rate // 30) == 0:
                    organ.vertices = given["nodes"] * np.float32(1.0 + 0.05 * np.sin(tick / 20))
                    for eye in eyes:
                        eye.image = np.roll(picture, tick, axis=0)
            tick += 1

    thread = threading.Thread(target=feed, daemon=True)
    thread.start()
    while sys.stdin.readline():
        print(json.dumps([server.get_port(), process_time(), viser.__version__]), file=answers, flush=True)
    ended.set()
    thread.join()
    server.stop()


async def _page(port: int, version: str, seconds: float) -> int:
    """Read all that comes for some time; return the bytes."""
    from websockets.asyncio.client import connect
    from websockets.typing import Subprotocol

    size, end = 0, monotonic() + seconds
    address, protocol = f"ws://127.0.0.1:{port}", Subprotocol(f"viser-v{version}")
    async with connect(address, subprotocols=[protocol], max_size=None) as socket:
        async for message in socket:
            size += len(message)
            if monotonic() > end:
                break
    return size


def _write_load(place: Path) -> None:
    """Write the meshes of the cart's bodies, and the organ of `bench.webconsole`."""
    from bench.webconsole import Fed, ring
    from webconsole.stage import Stage

    fed = Fed()
    fed.close()
    parts = Stage(fed.scenario, fed.outlets, fed.params).scenes["robot"].parts
    nodes, triangles = ring()
    load: dict[str, Any] = {"bodies": len(parts), "nodes": nodes, "triangles": triangles}
    for index, part in enumerate(parts):
        load |= {f"vertices{index}": part.vertices, f"faces{index}": part.faces}
    np.savez(place, **load)


def _in_chromium(port: int, seconds: float) -> dict[str, float]:
    from playwright.sync_api import sync_playwright

    from bench.webconsole import CHROMIUM

    flags = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=flags)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.add_init_script(COUNT_DRAWN)
        begun = perf_counter()
        page.goto(f"http://127.0.0.1:{port}")
        while not page.evaluate("window.drawn"):
            sleep(0.02)
        first_s = perf_counter() - begun
        sleep(3.0)
        drawn, begun = page.evaluate("window.drawn"), perf_counter()
        sleep(seconds)
        rate = (page.evaluate("window.drawn") - drawn) / (perf_counter() - begun)
        browser.close()
    return {"first_picture_s": round(first_s, 2), "frames_per_s": round(rate, 1)}


def measured(python: str, seconds: float, rate: int) -> dict[str, Any]:
    """Return the figures of viser, run by `python`."""
    with tempfile.TemporaryDirectory() as directory:
        load = Path(directory, "load.npz")
        _write_load(load)
        pipe = subprocess.PIPE
        command = [python, "-m", "bench.webconsole_viser", "--serve", str(load), "--rate", str(rate)]
        with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
            assert process.stdin is not None
            assert process.stdout is not None

            def ask() -> Any:
                print(file=process.stdin, flush=True)
                assert process.stdout is not None
                return json.loads(process.stdout.readline())

            port, _, version = ask()
            sleep(3.0)
            rows: dict[str, Any] = {"version": version}
            for name, run in (
                ("no page", lambda: sleep(seconds)),
                ("1 page", lambda: rows.update(bytes=asyncio.run(_page(port, version, seconds)))),
            ):
                before, begun = ask()[1], perf_counter()
                run()
                rows[f"{name}, core_percent"] = round(
                    100.0 * (ask()[1] - before) / (perf_counter() - begun), 1
                )
            rows["mb_per_s"] = round(rows.pop("bytes") / seconds / 1e6, 2)
            rows |= _in_chromium(port, seconds)
            process.stdin.close()
    return rows


def main() -> None:
    """Measure viser and the page of `trocar view`, in turns."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("python", nargs="?", help="an interpreter that has viser")
    parser.add_argument("--seconds", type=float, default=6.0)
    parser.add_argument("--rate", type=int, default=60, choices=(30, 60), help=argparse.SUPPRESS)
    parser.add_argument("--serve", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        serve(options.serve, options.rate)
        return
    from bench.webconsole import bench_page, bench_server

    for _ in range(2):
        for rate in (60, 30):
            print(f"viser, poses at {rate} Hz", measured(options.python, options.seconds, rate))
        print("ours", bench_server(options.seconds)["1 pages, pictures on"], bench_page(options.seconds))
    print("load", os.getloadavg())


if __name__ == "__main__":
    main()
