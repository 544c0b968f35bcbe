"""`trocar stitch` in a running session: its answers are printed, and a refusal is an error."""

import json
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from controllers.stitching.command_line import app
from hub.remote.live_sessions import live_sessions
from hub.transport.loopback_port import LoopbackPort
from schemas.errors import MotionError
from tests.devices.ros.test_stitch import scenario
from tests.waiting import until

pytestmark = pytest.mark.alone


@pytest.fixture
def endpoint(tmp_path):
    """The endpoint of a session that a person guides, without camera and gateway."""
    tree = scenario()
    del tree["participants"]["ros"]
    tree["connections"] = [one for one in tree["connections"] if "ros." not in one]
    file, place = tmp_path / "guided.json", LoopbackPort("tcp/127.0.0.1:0").endpoint
    file.write_text(json.dumps(tree))
    command = [sys.executable, "-P", "-m", "trocar", "run", str(file), "--listen", place]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as hub:
        try:
            until(lambda: any(status.step > 100 for status in live_sessions([place])))
            yield place
        finally:
            hub.terminate()


def test_a_refusal_ends_the_command_with_an_error(endpoint):
    def told(*words):
        done = CliRunner().invoke(app, [*words, "--connect", endpoint])
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            raise done.exception
        return done.output

    with pytest.raises(MotionError, match="'consent' while picking"):
        told("say", "consent", "00000000")
    picks = "pick", "--entry", "8", "18", "0", "--exit", "-8", "18", "0", "--frame", "phantom"
    entry, question = told(*picks).splitlines()
    assert entry == "the entry is picked, the exit is next"
    with pytest.raises(MotionError, match="a consent to '00000000'"):
        told("say", "consent", "00000000")
    assert told("say", *question.partition("?")[0].split()) == "running\n"
    with pytest.raises(MotionError, match="nowhere"):
        told(*picks[:-1], "nowhere")
