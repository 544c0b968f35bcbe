"""What a monitor takes of devices in this process: messages of their ports, and nothing else."""

from pathlib import Path

import numpy as np
import pytest

from hub.observation.measures import Measures
from hub.observation.monitor import Monitor
from hub.participant import Sample, VectorSample
from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from schemas.errors import MessageError
from schemas.keys import Keys
from schemas.ros import Float64Message, Header, PoseStamped
from schemas.vectors import VectorCodec

TEXT = """\
name: handed
step: 1 ms
duration: 10 ms
participants:
  player: {kind: "toys:Player"}
"""


@pytest.fixture
def watching(prepare, tmp_path: Path):
    """A monitor of a session with a device, its codec of the device's pose, and where it records."""
    session = prepare(TEXT)
    port = session.plan.participants["player"].port("hand")
    with Recorder(tmp_path / "run", attachments={}) as recorder:
        measures = Measures(session.scenario, session.plan)
        yield (
            Monitor(session.plan, Keys("handed"), 1, measures, recorder),
            VectorCodec(port),
            tmp_path / "run",
        )


def test_a_vector_of_the_port_is_recorded_as_its_bytes(watching):
    monitor, codec, directory = watching
    sample = VectorSample(codec, codec.neutral, 5)
    monitor.device_here("player", sample, 7, sample.encode(), enters=False)
    monitor.device_here("player", sample, 9, sample.encode(), enters=True)  # with its grant
    monitor.record()
    monitor._recorder.close()
    (message,) = Recording(directory).messages("/device/player/out/hand")
    assert (message.time_ns, message.payload) == (7, sample.encode())


def test_a_sample_that_is_none_of_the_port_is_refused(watching):
    monitor, codec, _ = watching
    elsewhere = VectorCodec(codec.port.model_copy(update={"frame": "elsewhere"}))
    twist = VectorCodec(codec.port.model_copy(update={"type": "geometry_msgs/msg/TwistStamped"}))
    for sample in (
        Sample("hand", Float64Message(data=1.0)),
        Sample("hand", PoseStamped(header=Header(frame_id="elsewhere"))),
        VectorSample(elsewhere, elsewhere.neutral, 0),
        VectorSample(twist, np.zeros(6), 0),
    ):
        with pytest.raises(MessageError, match=r"hand|PoseStamped"):
            monitor.device_here("player", sample, 0, sample.encode(), enters=False)
