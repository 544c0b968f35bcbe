"""Pictures on sockets: the messages of GStreamer's unixfd, readers that stall, come late or go."""

from __future__ import annotations

import mmap
import os
import select
import shutil
import socket
import struct
import subprocess
import sys
import threading
from collections.abc import Generator
from contextlib import closing
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

from devices.dvrk_video.device import DvrkVideo, DvrkVideoParams
from devices.dvrk_video.i420 import to_i420
from devices.dvrk_video.messages import timestamps
from devices.dvrk_video.socket_sink import SocketSink
from engines.mujoco.pictures import opengl
from hub.planning.scenario_file import load
from hub.session.launch import launch
from schemas.errors import DeviceError, MessageError
from schemas.ros import CompressedImage, Header, Image, Time
from tests.waiting import until

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="sockets of Linux")

COLOURS = ((255, 0, 0), (0, 255, 0), (20, 40, 200), (255, 255, 255))
WIDTH, HEIGHT = 64, 48
needs_gstreamer = pytest.mark.skipif(
    not shutil.which("gst-inspect-1.0")
    or subprocess.run(["gst-inspect-1.0", "unixfdsrc"], capture_output=True, check=False).returncode != 0,
    reason="needs unixfdsrc of GStreamer 1.24: apt install gstreamer1.0-tools gstreamer1.0-plugins-bad",
)


def names() -> dict[str, str]:
    """Names of sockets that no other test and no dVRK uses."""
    return {eye: f"@dvrk:test_{os.getpid()}_{threading.get_ident()}:{eye}" for eye in ("left", "right")}


class Reader:
    """What `unixfdsrc` does."""

    def __init__(self, name: str) -> None:
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(10.0)
        self.socket.connect("\0" + name[1:])

    def message(self) -> tuple[int, bytes, list[int]]:
        head, descriptors, _, _ = socket.recv_fds(self.socket, 8, 4)
        command, size = struct.unpack("<II", head)
        payload = self.socket.recv(size, socket.MSG_WAITALL) if size else b""
        return command, payload, descriptors

    def picture(self) -> tuple[int, bytes, bytes, int]:
        """Number, content, metadata and descriptor of the next picture."""
        command, payload, (descriptor,) = self.message()
        assert command == 0
        number, _, _, _, _, _, _, kind, memories, metas, size, offset = struct.unpack_from(
            "<6QI2BH2Q", payload
        )
        assert (kind, memories, metas, offset) == (0, 1, 1, 0)
        with mmap.mmap(descriptor, size, prot=mmap.PROT_READ) as view:
            return number, view[:], payload[72:], descriptor

    def release(self, number: int) -> None:
        self.socket.sendall(struct.pack("<IIQ", 1, 8, number))

    def nothing_waits(self) -> bool:
        """Whether no message has come."""
        return not select.select([self.socket], [], [], 0.0)[0]

    def close(self) -> None:
        self.socket.close()


@pytest.fixture
def device(tmp_path: Path) -> Generator[DvrkVideo]:
    video = DvrkVideo("video", DvrkVideoParams(**names()))
    with closing(video):
        video.open(tmp_path)
        yield video


def raw(colour: tuple[int, int, int], at_ns: int) -> Image:
    pixels = np.tile(np.array(colour, np.uint8), (HEIGHT, WIDTH, 1))
    header = Header(stamp=Time.from_ns(at_ns), frame_id="eye")
    return Image(
        header=header, height=HEIGHT, width=WIDTH, encoding="rgb8", step=3 * WIDTH, data=pixels.reshape(-1)
    )


def compressed(colour: tuple[int, int, int], at_ns: int) -> CompressedImage:
    file = BytesIO()
    Picture.new("RGB", (WIDTH, HEIGHT), colour).save(file, "png")
    data = np.frombuffer(file.getvalue(), np.uint8)
    return CompressedImage(header=Header(stamp=Time.from_ns(at_ns), frame_id="eye"), format="png", data=data)


def colour_of(content: bytes) -> np.ndarray:
    """The colour of a picture of one colour, from its planes by BT.601."""
    assert len(content) == WIDTH * HEIGHT * 3 // 2
    luma, blue, red = (float(content[at]) for at in (0, WIDTH * HEIGHT, WIDTH * HEIGHT * 5 // 4))
    light, blue, red = 1.164 * (luma - 16.0), blue - 128.0, red - 128.0
    return np.array([light + 1.596 * red, light - 0.392 * blue - 0.813 * red, light + 2.017 * blue])


@pytest.mark.parametrize(("port", "make"), [("image_raw", raw), ("image_raw/compressed", compressed)])
def test_a_reader_gets_the_pictures(device: DvrkVideo, port: str, make) -> None:
    with closing(Reader(device.params.left)) as left, closing(Reader(device.params.right)) as right:
        for i, colour in enumerate(COLOURS):
            device.write(f"left/{port}", make(colour, i))
            if i == 0:
                command, caps, _ = left.message()
                assert command == 2
                assert caps == (
                    b"video/x-raw, format=(string)I420, width=(int)64, height=(int)48,"
                    b" framerate=(fraction)25/1, pixel-aspect-ratio=(fraction)1/1,"
                    b" interlace-mode=(string)progressive, colorimetry=(string)bt601\0"
                )
            number, content, metadata, _ = left.picture()
            assert colour_of(content) == pytest.approx(colour, abs=4)
            assert b"left-source-ts=(gint64)1" in metadata
            left.release(number)
        assert right.nothing_waits()


def test_messages_are_those_of_gstreamer() -> None:
    """Bytes that unixfdsink of GStreamer 1.26.2 has sent for the metadata of dvrk_data."""
    assert timestamps({"left-source": 1795804537005248367}) == (
        b"\xe0\x00\x00\x00\x1d\x00\x00\x00DataCollectionFrameTimestamps\x00\x00DataCollectionFrameTimestamps,"
        b" mono-source-ts=(gint64)0, left-source-ts=(gint64)1795804537005248367, right-source-ts=(gint64)0,"
        b" stereo-output-ts=(gint64)0, overlay-output-ts=(gint64)0;\x00"
    )


def test_rows_of_odd_pictures_are_padded() -> None:
    planes = to_i420(np.full((3, 5, 3), 255, np.uint8))
    assert len(planes) == 8 * 4 + 2 * 4 * 2, "rows of four bytes, as GStreamer reckons them"


def test_nothing_is_drawn_or_sent_without_readers(device: DvrkVideo) -> None:
    broken = raw((0, 0, 0), 0).model_copy(update={"encoding": "mono8"})
    device.write("left/image_raw", broken)
    with closing(Reader(device.params.left)), pytest.raises(MessageError, match="encoding 'mono8'"):
        device.write("left/image_raw", broken)


def test_a_picture_published_twice_is_shown_once(device: DvrkVideo) -> None:
    with closing(Reader(device.params.left)) as reader:
        device.write("left/image_raw", raw((1, 2, 3), 7))
        device.write("left/image_raw/compressed", compressed((1, 2, 3), 7))
        reader.message()
        reader.picture()
        assert reader.nothing_waits()


def test_a_reader_that_stalls_gets_no_more_and_holds_up_nobody(device: DvrkVideo) -> None:
    with closing(Reader(device.params.left)) as stalled, closing(Reader(device.params.left)) as other:
        for i in range(30):
            device.write("left/image_raw", raw((i, 0, 0), i))
            if i == 0:
                other.message()
            number, *_ = other.picture()
            other.release(number)
        stalled.message()
        held = [stalled.picture() for _ in range(8)]
        assert stalled.nothing_waits()
        contents = {bytes(content) for _, content, _, _ in held}
        stalled.release(held[0][0])
        device.write("left/image_raw", raw((200, 0, 0), 99))
        _, newest, _, _ = stalled.picture()
        assert colour_of(newest)[0] == pytest.approx(200, abs=4), "the newest, not those between"
        with mmap.mmap(held[1][3], len(newest), prot=mmap.PROT_READ) as view:
            assert bytes(view) in contents, "a held picture is not written over"


def test_readers_come_and_go(device: DvrkVideo) -> None:
    for at_ns in range(40):
        with closing(Reader(device.params.left)) as late:
            device.write("left/image_raw", raw((9, 9, 9), at_ns))
            assert late.message()[0] == 2
            late.picture()
    device.read(0)
    assert not device._sinks["left"].serve()
    assert len(device._sinks["left"]._memories) <= 2, "memories are used again"


def test_a_reader_that_talks_nonsense_is_left(device: DvrkVideo) -> None:
    for nonsense in (struct.pack("<II", 1, 1 << 30), struct.pack("<IIQ", 1, 8, 77), struct.pack("<II", 2, 0)):
        with closing(Reader(device.params.left)) as reader:
            reader.socket.sendall(nonsense)
            device.read(0)
            assert reader.socket.recv(1) == b""


def test_an_unknown_command_is_skipped(device: DvrkVideo) -> None:
    with closing(Reader(device.params.left)) as reader:
        reader.socket.sendall(struct.pack("<II4s", 9, 4, b"more"))
        device.write("left/image_raw", raw((0, 0, 0), 0))
        assert reader.message()[0] == 2


def test_a_reader_cannot_change_a_picture(device: DvrkVideo) -> None:
    with closing(Reader(device.params.left)) as reader:
        device.write("left/image_raw", raw((0, 0, 0), 0))
        reader.message()
        *_, descriptor = reader.picture()
        with pytest.raises(PermissionError):
            os.pwrite(descriptor, b"x", 0)
        with pytest.raises(PermissionError):
            os.ftruncate(descriptor, 0)


def test_one_program_at_a_socket(device: DvrkVideo, tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="another program shows pictures there"):
        DvrkVideo("second", device.params).open(tmp_path)


def test_readers_are_told_the_end(device: DvrkVideo) -> None:
    with closing(Reader(device.params.left)) as reader:
        device.read(0)
        device.close()
        assert reader.message()[:2] == (3, b"")


def test_names_of_sockets_are_those_of_the_dvrk() -> None:
    with pytest.raises(ValueError, match="left"):
        DvrkVideoParams(left="/tmp/video.sock")
    with pytest.raises(DeviceError, match="cannot listen"):
        SocketSink("@dvrk:test:" + "x" * 200)


SCENARIO = """
name: video
step: 10 ms
duration: 300 s
pace: realtime
scene:
  arms: {{ECM: {{}}}}
  objects: {{ring: {{kind: ring, position: [0 mm, 0 mm, 10 mm]}}}}
participants:
  robot: {{kind: mujoco, publish_period: 10 ms}}
  camera: {{kind: endoscope, host: hub, period: 40 ms, width: 64, height: 48}}
  video: {{kind: dvrk-video, host: hub, left: "{left}", right: "{right}"}}
connections:
  - robot.qpos -> camera.qpos
  - camera.* -> video.*
"""


@pytest.fixture
def running(tmp_path: Path) -> Generator[dict[str, str]]:
    """A session with a camera; names of its sockets."""
    if not (found := opengl.find()).name:
        pytest.skip(f"no OpenGL: {found.detail}")
    sockets = names()
    file = tmp_path / "video.yaml"
    file.write_text(SCENARIO.format(**sockets))
    session = launch(load(str(file)))
    thread = threading.Thread(target=session.run)
    thread.start()
    try:
        assert until(lambda: sockets["right"] in Path("/proc/net/unix").read_text())
        yield sockets
    finally:
        session.state.shutdown()
        thread.join()


@pytest.mark.long
def test_a_session_shows_its_pictures(running: dict[str, str]) -> None:
    for name in running.values():
        with closing(Reader(name)) as reader:
            assert b"width=(int)64, height=(int)48" in reader.message()[1]
            first, second = reader.picture()[0], reader.picture()[0]
            assert second == first + 1


@needs_gstreamer
def test_gstreamer_reads_it(running: dict[str, str]) -> None:
    pipeline = (
        f"unixfdsrc socket-path={running['left'][1:]} socket-type=abstract num-buffers=5"
        " ! video/x-raw,format=I420,width=64,height=48 ! fdsink fd=1"
    )
    read = subprocess.run(
        ["gst-launch-1.0", "--quiet", *pipeline.split()], capture_output=True, timeout=60, check=False
    )
    assert read.returncode == 0, read.stderr.decode()
    assert len(read.stdout) == 5 * WIDTH * HEIGHT * 3 // 2
