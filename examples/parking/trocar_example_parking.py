"""A training task: park every object on a round spot of the table."""

import numpy as np

from trocar.quantities import Length
from trocar.tasks import Goals, Task, TaskParams


class ParkingParams(TaskParams):
    """Of the task, in a scenario, beside those that all tasks have."""

    spot: tuple[Length, Length, Length]  # m, its middle in the world
    radius: Length = 0.02  # m


class Parking(Task):
    """An object is parked once it has been let go and lies still with its middle over the spot."""

    params_model = ParkingParams
    name_of_kind = "parking"

    @property
    def goals(self) -> Goals:
        spot = frozenset({0})  # the index of the only place
        return Goals(places=("spot",), targets=(spot,) * len(self.things))

    def place_of(self, thing: int, pose: np.ndarray) -> int:
        away = pose[:2] - self.params.spot[:2]
        return 0 if np.hypot(*away) < self.params.radius else -1
