"""Links that are changed while a session runs: of devices in the hub's process, in another one, and in
simulated time.
"""

import json
import sys
import threading
from time import sleep

import pytest

from hub.command_line import main
from hub.devices.network_link_control import NetworkLinkReply, NetworkLinkRequest
from hub.remote.live_sessions import ask_about, live_sessions
from schemas.errors import ConnectError, MessageError
from schemas.network_link import NetworkLinkSpec
from tests.waiting import until

SCENARIO = """\
name: hand
step: 1 ms
pace: realtime
participants:
  player: {kind: "toys:Player", clock: wall, max_age_ms: 60, network_link: {jitter: 1 ms}}
  hand: {kind: "toys:Hand"}
  deaf: {kind: "toys:Deaf"}
  mixer: {kind: "toys:Mixer"}
connections:
  - player.hand -> deaf.hand
  - player.buttons -> deaf.buttons
  - hand.out -> mixer.a
  - mixer.out -> hand.numbers
measure:
  fresh_steps: {kind: final, of: deaf.fresh_steps, live: true}
"""


def during(session, act, progress=None):
    """Run a session and `act` beside it; what goes wrong in `act` is raised here."""
    failed = []

    def console():
        try:
            while not any(
                status.state == "running" and status.step > 20 for status in live_sessions([session.endpoint])
            ):
                sleep(0.02)
            act()
        except Exception as error:  # noqa: BLE001
            failed.append(error)
        finally:
            session.state.shutdown()

    thread = threading.Thread(target=console)
    thread.start()
    summary = session.run(progress)
    thread.join()
    if failed:
        raise failed[0]
    return summary


def relink(session, device="player", **change):
    return ask_about(
        device,
        [session.endpoint],
        "link",
        NetworkLinkRequest.model_validate({"device": device, **change}),
        NetworkLinkReply,
    ).link


@pytest.mark.long
@pytest.mark.parametrize("host", ["hub", "other"])
def test_a_link_is_changed_while_the_session_runs(prepare, host):
    session = prepare(SCENARIO, f"participants.player.host={host}")

    def status():
        return live_sessions([session.endpoint])[0]

    def act():
        assert relink(session, preset="70 ms") == NetworkLinkSpec(preset="70 ms", jitter="1 ms")
        until(lambda: any(device.link == "70 ms each way, up to 1 ms more" for device in status().devices))
        until(lambda: any(one.stream == "player.hand" and one.largest_s > 0.07 for one in status().latencies))
        assert relink(session, "hand", delay="5 ms", loss=0.5) == NetworkLinkSpec(delay="5 ms", loss=0.5)
        assert relink(session, delay="1 ms", jitter="0 ms") == NetworkLinkSpec(delay="1 ms")
        with pytest.raises(MessageError, match=r"Input should be less than 1"):
            relink(session, loss=1.5)
        with pytest.raises(
            ConnectError, match=r"there is no 'nobody' in any session of these hubs; running: hand"
        ):
            relink(session, "nobody")
        if host == "other":
            until(lambda: status().devices[0].round_trip_ns > 0)
            # one machine, one clock
            assert abs(status().devices[0].offset_ns) <= status().devices[0].round_trip_ns
        sleep(0.5)

    summary = during(session, act)
    rows = summary.latency["device to grant"]
    assert rows["player.hand"]["largest_s"] > 0.07
    assert rows["hand.out"]["largest_s"] == pytest.approx(0.005)
    assert summary.latency["state to force"]["hand.numbers"]["largest_s"] == pytest.approx(0.005)


def test_the_arm_holds_in_an_outage_and_continues_after_it(prepare):
    session = prepare(SCENARIO)
    fresh = []

    latest = []

    def count():
        return latest[-1].live.get("fresh_steps", (0.0, ""))[0]

    def act():
        relink(session, outage="500 ms")
        sleep(0.3)
        fresh.append(count())
        sleep(0.1)
        fresh.append(count())
        until(lambda: count() > fresh[1] + 100)

    during(session, act, latest.append)
    assert fresh[1] - fresh[0] < 50


@pytest.mark.long
def test_on_the_command_line(prepare, monkeypatch, capfd):
    monkeypatch.setenv("COLUMNS", "160")
    session = prepare(SCENARIO)
    seen = []

    def trocar(*arguments):
        monkeypatch.setattr(sys, "argv", ["trocar", *arguments, "--connect", session.endpoint])
        with pytest.raises(SystemExit) as left:
            main()
        seen.append((left.value.code or 0, *capfd.readouterr()))

    def act():
        trocar("link", "player", "--preset", "300 ms", "--json")
        trocar("link", "player", "--outage", "3 s")
        trocar("link", "player", "--preset", "150 ms")
        trocar("link", "player", "--loss", "1")
        until(lambda: live_sessions([session.endpoint])[0].latencies)
        until(lambda: live_sessions([session.endpoint])[0].devices)
        trocar("ls", "--json")
        trocar("ls")

    during(session, act)
    as_json, outage, wrong, refused, listed, shown = seen
    assert json.loads(as_json[1])["link"]["preset"] == "300000000 ns"
    assert "from now on: 300 ms each way, up to 1 ms more, nothing at all for 3 s" in " ".join(
        outage[1].split()
    )
    assert wrong[0] == 2
    assert "150 ms is no preset" in wrong[2]
    assert refused[2].strip() == "error: loss: Input should be less than 1 (got 1.0)"
    (row,) = json.loads(listed[1])
    assert row["devices"][0]["device"] == "player"
    assert {one["way"] for one in row["latency"]} == {"device to grant", "grant to state", "state to force"}
    assert "state to" in shown[1], "a narrow terminal wraps the word force"
