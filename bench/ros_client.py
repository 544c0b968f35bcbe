"""The console of `bench/ros.py`: a ROS program in a process of its own, which prints its results as JSON.

    python bench/ros_client.py KIND WHERE TASK '{"...": ...}'

Says `ready` once all is declared, and reads a line on stdin before it begins; to end what it listens to,
another one. Its client logic is that of a CRTK client: a move is over when a state that is busy and newer
than the command has come, and then one that is not.
"""

from __future__ import annotations

import json
import math
import random
import sys
import threading
from itertools import pairwise
from time import monotonic, sleep, time_ns
from typing import Any

from ros_figures import MOVED_RAD, percentiles
from ros_middleware import JOINT_STATE, MIDDLEWARE, OPERATING_STATE, STRING_STAMPED

PATIENCE_S = 10.0
"""How long the busy edge of a move or of homing may take, and the end of it; more is a miss, and a hang."""


def begin(client: Any) -> None:
    """Say that all is declared, and wait until the other side is ready, too."""
    client.start()
    print("ready", flush=True)
    sys.stdin.readline()


class Heard:
    """What came on one topic: when it was stamped and how old it was, and its numbers."""

    def __init__(self, client: Any) -> None:
        self._client, self.seen = client, []

    def take(self, message: Any, number: int | None) -> None:
        now_ns = time_ns()
        stamp_ns = self._client.stamp_ns(message)
        self.seen.append((stamp_ns, now_ns - stamp_ns, number))

    def figures(self, begun_ns: int, ended_ns: int) -> dict[str, Any]:
        """Return rate, losses and ages of what was stamped between two times."""
        seen = [row for row in self.seen if begun_ns <= row[0] <= ended_ns]
        if len(seen) < 2:
            return {"count": len(seen)}
        stamps, numbers = [row[0] for row in seen], [row[2] for row in seen]
        gaps = [after - before for before, after in pairwise(stamps)]
        rate = (len(seen) - 1) / (stamps[-1] - stamps[0]) * 1e9
        lost = None if None in numbers else numbers[-1] - numbers[0] + 1 - len(numbers)
        return {
            "rate_hz": round(rate, 2),
            "lost": lost,
            "longest_gap_ms": round(max(gaps) / 1e6, 2),
            "age": percentiles([row[1] for row in seen]),
        }


def listen(client: Any, topics: list[tuple[str, str]], seconds: float) -> dict[str, Any]:
    """Listen to topics for a while."""
    heard = {topic: Heard(client) for topic, _ in topics}
    for topic, type_ in topics:
        client.listen(topic, type_, heard[topic].take)
    begin(client)
    sleep(1.0)
    begun_ns = time_ns()
    sleep(seconds)
    ended_ns = time_ns()
    sys.stdin.readline()  # all has been told
    sleep(0.5)
    return {topic: one.figures(begun_ns, ended_ns) for topic, one in heard.items()} | {
        "received": {topic: len(one.seen) for topic, one in heard.items()}
    }


class Arm:
    """One arm, as a client sees it."""

    def __init__(self, client: Any, name: str) -> None:
        self._client, self._name = client, name
        self.news = threading.Condition()
        self.events: list[tuple[int, Any]] = []
        """Stamp and message of each operating state, in order."""
        self.joints: dict[str, Any] = {}
        """The newest state by its topic's name, with the time (ns) of its arrival."""
        client.listen(f"/{name}/operating_state", OPERATING_STATE, self._state, latched=True)
        for topic in ("measured_js", "setpoint_js"):
            client.listen(
                f"/{name}/{topic}", JOINT_STATE, lambda message, _, topic=topic: self._joints(topic, message)
            )
        for topic, type_ in (
            ("servo_jp", JOINT_STATE),
            ("move_jp", JOINT_STATE),
            ("state_command", STRING_STAMPED),
        ):
            client.advertise(f"/{name}/{topic}", type_)

    def _state(self, message: Any, _: int | None) -> None:
        stamp_ns = self._client.stamp_ns(message)
        with self.news:
            if not self.events or stamp_ns > self.events[-1][0]:  # as a CRTK client does
                self.events.append((stamp_ns, message))
                self.news.notify_all()

    def _joints(self, topic: str, message: Any) -> None:
        now_ns = time_ns()
        with self.news:
            self.joints[topic] = list(message.position), now_ns, self._client.stamp_ns(message)
            self.news.notify_all()

    def await_state(self, after_ns: int, wanted: Any, limit_s: float) -> int | None:
        """Return the stamp of the first matching state after `after_ns`; None if none arrives in time."""
        at = 0

        def found() -> int | None:
            nonlocal at
            while at < len(self.events):
                stamp_ns, message = self.events[at]
                at += 1
                if stamp_ns > after_ns and wanted(message):
                    return stamp_ns
            return None

        with self.news:
            return self.news.wait_for(found, limit_s)

    def await_joints(self) -> None:
        with self.news:
            assert self.news.wait_for(lambda: len(self.joints) == 2, 20.0), f"no joint states of {self._name}"

    def command(self, text: str) -> int:
        return self._client.words(f"/{self._name}/state_command", text)

    def send(self, command: str, positions: list[float]) -> int:
        return self._client.joints(f"/{self._name}/{command}", positions)


def home(arm: Arm) -> None:
    since_ns = arm.command("home")
    assert arm.await_state(since_ns, lambda state: state.is_homed and not state.is_busy, 20.0), (
        "the arm did not get home"
    )


def servo(client: Any, arm_name: str, count: int) -> dict[str, Any]:
    """Command an arm by 2 mrad to and fro, and record when its setpoint and its joint follow."""
    arm, times, pause = Arm(client, arm_name), {"setpoint_js": [], "measured_js": []}, random.Random(0)
    stamped: dict[str, list[int]] = {"setpoint_js": [], "measured_js": []}
    begin(client)
    arm.await_joints()
    home(arm)
    goal, never = list(arm.joints["setpoint_js"][0]), 0
    for index in range(count):
        sleep(pause.uniform(0.3, 0.32))
        with arm.news:
            before = {topic: joints[0][0] for topic, joints in arm.joints.items()}
        goal[0] += 2e-3 if index % 2 else -2e-3
        sent_ns = arm.send("servo_jp", goal)
        for topic in times:
            with arm.news:
                if arm.news.wait_for(
                    lambda topic=topic, before=before: (
                        abs(arm.joints[topic][0][0] - before[topic]) > MOVED_RAD
                    ),
                    1.0,
                ):
                    times[topic].append(arm.joints[topic][1] - sent_ns)
                    stamped[topic].append(arm.joints[topic][2] - sent_ns)
                else:
                    never += 1
    return {"never_seen": never} | {
        f"to_{topic}": {"at_console": percentiles(times[topic]), "as_stamped": percentiles(stamped[topic])}
        for topic in times
    }


def moves(client: Any, arm_name: str, count: int) -> dict[str, Any]:
    """`move_jp(...).wait()`, 2 mrad to and fro."""
    arm, took_ns, missed, hung = Arm(client, arm_name), [], 0, 0
    begin(client)
    arm.await_joints()
    home(arm)
    goal = list(arm.joints["setpoint_js"][0])
    for index in range(count):
        goal[0] += 2e-3 if index % 2 else -2e-3
        since_ns = arm.send("move_jp", goal)
        busy_ns = arm.await_state(since_ns, lambda state: state.is_busy, PATIENCE_S)
        missed += busy_ns is None
        if arm.await_state(busy_ns or since_ns, lambda state: not state.is_busy, PATIENCE_S) is None:
            hung += 1
        took_ns.append(time_ns() - since_ns)
    return {"moves": count, "missed_busy_edges": missed, "hung": hung, "took": percentiles(took_ns)}


def cycles(client: Any, arm_name: str, count: int) -> dict[str, Any]:
    """Enable and home from nothing, as a client does in the morning, and release everything again."""
    arm, took_ns, missed, hung = Arm(client, arm_name), [], 0, 0
    begin(client)
    arm.await_joints()
    home(arm)
    for _ in range(count):
        for words, wanted in (
            ("unhome", lambda state: not state.is_homed),
            ("disable", lambda state: state.state == "DISABLED"),
            ("enable", lambda state: state.state == "ENABLED" and not state.is_busy),
            ("home", lambda state: state.is_homed and not state.is_busy),
        ):
            since_ns = arm.command(words)
            if words in ("enable", "home"):
                missed += arm.await_state(since_ns, lambda state: state.is_busy, PATIENCE_S) is None
            if arm.await_state(since_ns, wanted, PATIENCE_S) is None:
                hung += 1
        took_ns.append(time_ns() - since_ns)
    return {"cycles": count, "missed_busy_edges": missed, "hung": hung, "homing_took": percentiles(took_ns)}


def stream(client: Any, arm_name: str, rate: float, seconds: float) -> dict[str, Any]:
    """Read joint states and send `servo_jp` at a steady rate, 20 mrad to and fro in 4 s."""
    arm, amplitude_rad, cycle_s, sent = Arm(client, arm_name), 0.02, 4.0, 0
    begin(client)
    arm.await_joints()
    with arm.news:
        start = list(arm.joints["setpoint_js"][0])
    begun = monotonic()
    while (now := monotonic() - begun) < seconds:
        arm.send("servo_jp", [start[0] + amplitude_rad * math.sin(2 * math.pi * now / cycle_s), *start[1:]])
        sent += 1
        sleep(max(0.0, begun + sent / rate - monotonic()))
    with arm.news:
        return {"sent": sent, "read": sorted(arm.joints)}


TASKS = {"listen": listen, "servo": servo, "moves": moves, "cycles": cycles, "stream": stream}


def main() -> None:
    kind, where, task, arguments = sys.argv[1:5]
    client = MIDDLEWARE[kind](where)
    begun = monotonic()
    try:
        result = TASKS[task](client, **json.loads(arguments))
        print(json.dumps(result | {"seconds": round(monotonic() - begun, 1)}), flush=True)
    finally:
        client.close()


if __name__ == "__main__":
    main()
