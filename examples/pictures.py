"""Write the last picture of every camera in a recording, as the JPEG or PNG that it was recorded as.

    trocar run cart --record recordings/cart
    python examples/pictures.py recordings/cart pictures

Pictures are recorded compressed where the endoscope's `images` is `compressed` or `both`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from rosbags.highlevel import AnyReader

from schemas.codec import decode
from schemas.ros import CompressedImage


def write(recording: Path, folder: Path) -> None:
    """Write `<participant>_<left or right>.<format>` to `folder` for every camera of `recording`."""
    folder.mkdir(parents=True, exist_ok=True)
    with AnyReader([recording]) as reader:
        cameras = [
            connection for connection in reader.connections if connection.msgtype == CompressedImage.ros_type
        ]
        last = {connection.topic: data for connection, _, data in reader.messages(cameras)}
        for topic, data in last.items():
            picture = decode(CompressedImage, bytes(data))
            participant, eye = (
                topic.removeprefix("/engine/").removesuffix("/image_raw/compressed").split("/out/")
            )
            file = folder / f"{participant}_{eye}.{picture.format}"
            file.write_bytes(picture.data.tobytes())
            print(file)


if __name__ == "__main__":
    write(Path(sys.argv[1]), Path(sys.argv[2]))
