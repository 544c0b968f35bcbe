"""Draws with Filament in a process of its own: a renderer whose driver fails aborts its process.

A camera starts `python -m` of this module, sends parameters once and a state for each picture. The process
draws one scene after the other, so a camera that is made anew need not wait for imports again.
"""

from __future__ import annotations

import json
import os
import signal
import sys
from typing import Any, BinaryIO

import numpy as np

from engines.mujoco.pictures import opengl
from engines.mujoco.pictures.drawing_frames import read_frame, write_frame
from engines.mujoco.pictures.endoscope_params import EndoscopeParams

__all__ = ["main"]


def main() -> None:
    """Answer frames until the camera ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a terminal; the camera says when to end
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what drivers print
    questions = sys.stdin.buffer
    try:
        while True:
            opening, _ = read_frame(questions)
            _draw_scene(opening, questions, answers)
    except (EOFError, OSError):
        return


def _draw_scene(opening: dict[str, Any], questions: BinaryIO, answers: BinaryIO) -> None:
    """Draw states of one scene until it is closed."""
    opengl.import_mujoco()
    from engines.mujoco.pictures.endoscope_scene import EndoscopeScene
    from engines.mujoco.pictures.filament.backend import Backend
    from engines.mujoco.pictures.seen_state import SeenState

    params = EndoscopeParams.model_validate_json(json.dumps(opening["params"]))
    state = SeenState(params)
    for organ, (may_change, may_be_wet) in opening["bodies"].items():
        state.bodies[organ].may_change, state.bodies[organ].may_be_wet = may_change, may_be_wet
    backend, scene = Backend(**opening["backend"]), None
    if not state.bodies:  # all is known
        scene = EndoscopeScene(params, backend)
        write_frame(answers, {})
    try:
        while True:
            header, saved = read_frame(questions)
            if not header:
                return
            state.restore(saved)
            scene = scene or EndoscopeScene(params, backend, state.bodies)
            left, right = scene.draw(state.positions, state.markers, header["time_ns"])
            pixels = (np.ascontiguousarray(eye).data.cast("B") for eye in (left, right))
            write_frame(answers, {"lens": scene.lens.tolist()}, *pixels)
    finally:
        if scene is not None:
            scene.close()


if __name__ == "__main__":
    main()
