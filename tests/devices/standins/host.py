"""A device host in small, to be killed: `python host.py LIBRARY PLANES [STYLUSES]`, with TROCAR_STANDIN_HD
set. Reads at 1 kHz and sends contact at 250 Hz.

Each hand is on a floor 10 mm above the origin of its base frame, made of up to four planes.
"""

from __future__ import annotations

import sys
from pathlib import Path
from time import monotonic_ns, sleep

from devices.openhaptics.device import Touch
from devices.openhaptics.params import TouchParams
from schemas.ros import Header, Time, Vector3
from schemas.trocar_msgs import ContactModel, ContactPlane

HEIGHT, STIFFNESS = 0.01, 200.0
_LEANS = (0.0, 0.1, -0.1, 0.2)
_PERIOD, _EVERY = 0.001, 4


def floor(time_ns: int, planes: int) -> ContactModel:
    """Return a floor of `planes` planes that lean a little."""
    normals = [Vector3(x=lean, z=(1.0 - lean * lean) ** 0.5) for lean in _LEANS[:planes]]
    surfaces = [
        ContactPlane(normal=n, distance=HEIGHT, stiffness=STIFFNESS / planes, damping=1.0, friction=0.3)
        for n in normals
    ]
    return ContactModel(header=Header(stamp=Time.from_ns(time_ns)), planes=surfaces)


def main() -> None:
    """Go on until killed."""
    styluses = {"right": {}, "left": {"device": "left"}}
    if sys.argv[3:] == ["1"]:
        del styluses["left"]
    touch = Touch("touch", TouchParams.model_validate({"library": sys.argv[1], "styluses": styluses}))
    touch.open(Path.cwd())
    start, tick = monotonic_ns(), 0
    while True:
        now = monotonic_ns() - start
        touch.read(now)
        if tick % _EVERY == 0:
            for stylus in styluses:
                touch.write(f"{stylus}/contact", floor(now, int(sys.argv[2])))
        tick += 1
        sleep(max(0.0, tick * _PERIOD - (monotonic_ns() - start) * 1e-9))


if __name__ == "__main__":
    main()
