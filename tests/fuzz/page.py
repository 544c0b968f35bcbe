"""Mutated requests and commands of a page: each is done, or refused with a sentence.

`python -m tests.fuzz.page --number 10000 --seed 7`. Requests go through the gate, commands
to the arguments that would start a session; no process is started.
"""

from __future__ import annotations

import asyncio
import json
import random
import sys
from functools import cache
from pathlib import Path
from typing import Any

from hub.planning.scenario_file import load
from schemas.errors import TrocarError
from tests.fuzz.byte_mutations import NUMBERS, WORDS, mutated, mutated_text
from tests.fuzz.harness import Note, Target, search
from webconsole.changes import overrides
from webconsole.commands import Start, command
from webconsole.gate import Gate
from webconsole.start import start_arguments

ORIGIN = "http://127.0.0.1:8470"
COMMANDS: list[dict[str, Any]] = [
    {"do": "show", "numbers": ["robot.qpos"], "pictures": True, "again": False},
    {"do": "at", "time": 1.5},
    {"do": "network", "device": "stylus", "delay": 0.1, "jitter": 0.01, "loss": 0.1},
    {
        "do": "start",
        "scenario": "table",
        "changes": {"teleop.scale": 0.5, "teleop.law": "pose"},
        "lead": ["stylus"],
    },
    {"do": "start", "scenario": "ros", "changes": {"duration": 1.0, "robot.looks": False}, "pace": "fast"},
    {"do": "fork", "time": 0.5, "changes": {"robot.seed": 3}, "duration": 2.0, "record": False},
    {"do": "hand", "number": 3, "linear": [0, 0.5, 1], "dead_man": True},
    {"do": "pick", "picture": "endoscope.left/image_raw", "x": 1.0, "y": 2.0},
    {"do": "say", "word": "consent 3f2a91c0"},
]
VALUES: list[Any] = [
    "ros2-dds",
    "subnet",
    "!!binary c2Vj",
    "{kind: fmu}",
    [1],
    {"a": 1},
    True,
    1e400,
    -1,
    None,
]
PATHS = [
    "stylus.kind",
    "stylus.host",
    "participants.x",
    "ros.discovery",
    "ros.master",
    "robot.model",
    "name",
    "scene",
]
COOKIES = ['trocar_8470="' + "\\377" * 25_000, 'a="' + '\\"' * 9000, ";" * 60_000, "trocar_8470=x;" * 5000]


@cache
def _gate() -> Gate:
    async def passed(scope: Any, receive: Any, send: Any) -> None:
        raise AssertionError(f"{scope['path']!r} was let in")

    return Gate(passed, [ORIGIN])


def _request(source: random.Random, note: Note) -> None:
    """Send a request of a stranger through the gate; it is answered with a refusal."""
    label, target = mutated_text(b"/?token=abcdefghijklmnop", source)
    headers = [(b"host", b"127.0.0.1:8470"), (b"origin", ORIGIN.encode()), (b"cookie", b"trocar_8470=abc")]
    at = source.randrange(len(headers))
    value = source.choice(COOKIES).encode() if source.random() < 0.2 else mutated(headers[at][1], source)[1]
    headers[at] = headers[at][0], value
    note(f"request: {label}, {headers[at][0].decode()}")
    path, _, query = target.partition(b"?")
    scope = {
        "type": source.choice(["http", "websocket"]),
        "method": source.choice(["GET", "HEAD", "POST"]),
        "path": path.decode("latin-1"),
        "query_string": query,
        "headers": headers,
    }
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {"type": "http.request", "body": b""}

    asyncio.run(_gate()(scope, receive, send))
    assert sent[0].get("status", 403) in (403, 431), sent
    assert sent[0]["type"] in ("http.response.start", "websocket.close"), sent


def _command(source: random.Random, note: Note) -> None:
    """Read a command; what it changes is a number, a switch or a choice of a kind that allows it."""
    asked = json.loads(json.dumps(source.choice(COMMANDS)))
    if "changes" in asked and source.random() < 0.7:
        for _ in range(source.choice([1, 3])):
            path = source.choice([*PATHS, *asked["changes"], source.choice(WORDS).decode("utf-8", "replace")])
            asked["changes"][path] = source.choice([*VALUES, source.choice(NUMBERS), 0.25, "velocity"])
        note(f"changes: {asked['changes']}"[:300])
        text = json.dumps(asked)
    else:
        label, data = mutated_text(json.dumps(asked).encode(), source)
        note(f"{asked['do']}: {label}")
        text = data.decode("utf-8", "replace")
    order = command(text)
    if isinstance(order, Start):
        scenario = load(order.scenario).scenario if order.scenario in ("table", "ros") else None
        arguments = start_arguments(order, Path.cwd())
        assert scenario is not None
        changes = overrides(scenario, order.changes)
        assert not set(order.changes) & {*PATHS}, changes
        assert all(isinstance(value, bool | int | float | str | None) for value in order.changes.values())
        assert [f"--set={change}" for change in changes] == [
            one for one in arguments if one.startswith("--set=") and "{kind: browser" not in one
        ]


def attempt(case: str, _directory: Path, note: Note) -> None:
    """Try the request or command of `case`, SEED:NUMBER."""
    source = random.Random(case)
    source.choice([_request, _command, _command])(source, note)


def pristine(_directory: Path) -> None:
    """Read what is not mutated."""
    for asked in COMMANDS:
        command(json.dumps(asked))
    try:
        start_arguments(Start(do="start", scenario="table"), Path.cwd())
        load("ros")
    except TrocarError as error:
        raise AssertionError("the scenarios are sound") from error


if __name__ == "__main__":
    sys.exit(search(Target(attempt, pristine, batch=50), __doc__ or "", hours=0.25))
