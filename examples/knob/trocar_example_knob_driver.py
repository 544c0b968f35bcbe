"""A driver: a knob in a hand that goes up and down, computed in place of a vendor's library."""

from math import cos, tau

from trocar.haptics import Driver, Opened, Reading

MASS, STIFFNESS, DAMPING = 0.1, 100.0, 5.0  # kg, N/m, N s/m: knob and hand
LEVEL = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)  # rotation matrix, row after row


class KnobDriver(Driver):
    """One knob; its hand goes from 20 mm above the origin to 20 mm below it and back."""

    def __init__(self, period):
        super().__init__()
        self.period = period  # s
        self.height, self.speed, self.force = 0.02, 0.0, 0.0  # m, m/s, N
        self.begun = self.time = None

    def open(self, spec):
        return Opened(handle=0, hardware="knob 1", force=3.3, stiffness=400.0, damping=4.0)

    def read(self, handle, now):
        if self.time is None:
            self.begun = self.time = now
        dt, self.time = min(now - self.time, 0.005), now  # s
        hand = 0.02 * cos(tau * (now - self.begun) / self.period)
        force = STIFFNESS * (hand - self.height) - DAMPING * self.speed + self.force
        self.speed += dt * force / MASS
        self.height += dt * self.speed
        return Reading((0.0, 0.0, self.height), LEVEL, (0.0, 0.0, self.speed), buttons=1)

    def write(self, handle, force):
        self.force = force[2]

    def close(self, handle):
        self.force = 0.0
