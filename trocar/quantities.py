"""Types of parameters that are written with a unit in a scenario (`80 mm`) and arrive in SI units.

    from trocar import Params
    from trocar.quantities import Length, Stiffness

    class SpringParams(Params):
        rest: Length = 0.08            # m
        stiffness: Stiffness = 100.0   # N/m

A bare number is taken in the SI unit; another dimension is refused. `Duration` is an integer of nanoseconds.
"""

from schemas.quantity import (
    Acceleration,
    Angle,
    Damping,
    Density,
    Duration,
    Force,
    Length,
    Mass,
    Pressure,
    Speed,
    Stiffness,
)

__all__ = [
    "Acceleration",
    "Angle",
    "Damping",
    "Density",
    "Duration",
    "Force",
    "Length",
    "Mass",
    "Pressure",
    "Speed",
    "Stiffness",
]
