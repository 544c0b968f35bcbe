"""Write the last picture of every camera in a recording, as the JPEG or PNG that it was recorded as.

    trocar run cart --record recordings/cart
    python examples/pictures.py recordings/cart pictures

Pictures are recorded compressed where the endoscope's `images` is `compressed` or `both`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from trocar import Recording
from trocar.messages import CompressedImage


def write(recording: Recording, folder: Path) -> None:
    """Write `<participant>_<left or right>.<format>` to `folder` for every camera of `recording`."""
    folder.mkdir(parents=True, exist_ok=True)
    for port, kind in recording.ports.items():
        if kind == CompressedImage.ros_type and len(recording[port]):
            *_, (_, picture) = recording[port].messages()
            camera = port.removesuffix("/image_raw/compressed").replace(".", "_")
            file = folder / f"{camera}.{picture.format}"
            file.write_bytes(picture.data.tobytes())
            print(file)


if __name__ == "__main__":
    write(Recording(sys.argv[1]), Path(sys.argv[2]))
