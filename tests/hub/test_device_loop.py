import threading
from pathlib import Path

import numpy as np

from hub.device_loop import DeviceLoop
from hub.participant import Device, Params, Sample
from schemas.ros import DiagnosticStatus, Float64Message, Joy

MS = 1_000_000


class Speaker(Device):
    """Says everything once, at its first reading, and goes on with numbers."""

    def __init__(self):
        super().__init__("speaker", Params())
        self.read_twice, self.readings = threading.Event(), 0

    ports = ()

    def open(self, directory):
        pass

    def read(self, t):
        self.readings += 1
        if self.readings == 1:
            told = [DiagnosticStatus(level=level, name="speaker", message=str(level)) for level in (2, 0)]
            return [Sample("buttons", Joy(buttons=np.array([1], np.int32))), *(Sample("diagnostics", status) for status in told)]
        self.read_twice.set()
        return [Sample("number", Float64Message(data=float(self.readings)))]

    def close(self):
        pass


class Listener:
    def __init__(self):
        self.heard, self.told = [], threading.Event()

    def exchange(self, t, samples):
        self.heard += samples
        self.told.set()


def test_who_listens_late_is_told_first_how_buttons_and_diagnoses_stand():
    speaker = Speaker()
    loop = DeviceLoop("speaker", speaker, MS, failed=lambda name, cause: None)
    loop.start(Path())
    try:
        assert speaker.read_twice.wait(5.0)
        for _ in range(2):
            listener = Listener()
            loop.attach(listener)
            assert listener.told.wait(5.0)
            loop.attach(None)
            buttons, diagnosis = listener.heard[:2]
            assert (buttons.port, buttons.message.buttons.tolist()) == ("buttons", [1])
            assert (diagnosis.port, diagnosis.message.level) == ("diagnostics", 0)
            assert {sample.port for sample in listener.heard[2:]} <= {"number"}
    finally:
        loop.close()
