"""The MuJoCo model of the patient cart of a da Vinci Research Kit, from the numbers in `robots.dvrk`."""

from engines.mujoco.model.names import CONTACT, first_sensor, instrument_body, probe_body
from engines.mujoco.model.scene import build, place, spec

__all__ = ["CONTACT", "build", "first_sensor", "instrument_body", "place", "probe_body", "spec"]
