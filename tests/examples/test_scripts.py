"""The scripts in examples/: what they write is what the scenarios have, or what a recording holds."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hub.recording.recorder import Recorder
from schemas.codec import encode
from trocar import Recording, TrocarError, write_bag
from trocar.messages import CompressedImage, Float64Message

ROOT = Path(__file__).resolve().parents[2]


def run(script: str, *arguments: str | Path) -> str:
    command = [sys.executable, str(ROOT / "examples" / script), *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout


@pytest.mark.long
@pytest.mark.parametrize(
    ("script", "data"), [("palpation_hand.py", "palpation_hand"), ("head_motion.py", "head")]
)
def test_the_data_of_the_scenarios_is_what_they_write(script: str, data: str, tmp_path: Path) -> None:
    run(script, tmp_path / "bag")
    run(script, tmp_path / "bag")  # replaces it
    committed = Recording(ROOT / "configs" / "data" / data)
    assert list(Recording(tmp_path / "bag").messages()) == list(committed.messages())


def test_the_last_picture_of_each_camera_becomes_a_file(tmp_path: Path) -> None:
    with Recorder(tmp_path / "run", attachments={}) as recorder:
        for eye in ("left", "right"):
            topic = f"/engine/endoscope/out/{eye}/image_raw/compressed"
            channel = recorder.add_channel(topic, CompressedImage.ros_type)
            for byte in range(3 if eye == "left" else 0):
                picture = CompressedImage(format="jpeg", data=np.array([byte], np.uint8))
                recorder.write(channel, byte, encode(picture))
    written = tmp_path / "pictures" / "endoscope_left.jpeg"
    assert run("pictures.py", tmp_path / "run", tmp_path / "pictures").split() == [str(written)]
    assert written.read_bytes() == b"\x02"


def test_a_bag_overwrites_nothing(tmp_path: Path) -> None:
    rows = [("/number", 5, Float64Message(data=2.0)), ("/number", 9, Float64Message(data=3.0))]
    write_bag(tmp_path / "bag", rows)
    number = Recording(tmp_path / "bag")["/number"]
    assert number.values.tolist() == [[2.0], [3.0]]
    assert number.time.tolist() == [5e-9, 9e-9]
    with pytest.raises(TrocarError, match=r"cannot write the bag .*; name a new directory"):
        write_bag(tmp_path / "bag", rows)
