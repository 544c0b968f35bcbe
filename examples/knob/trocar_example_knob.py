"""A haptic device: knobs, each behind `KnobDriver` in the servo process."""

from pathlib import Path
from typing import Any

from trocar import Params
from trocar.haptics import HapticDevice, StylusParams
from trocar.quantities import Duration


class KnobParams(Params):
    """Parameters of the knob, in a scenario."""

    right: StylusParams = StylusParams()
    period: float = 4.0  # s
    max_age: Duration = 100_000_000  # ns


class Knob(HapticDevice):
    """One knob: ports `right/pose`, `right/twist`, `right/buttons`, `right/force` and `right/contact`."""

    params_model = KnobParams
    driver = "trocar_example_knob_driver:KnobDriver"

    def __init__(self, name: str, params: KnobParams) -> None:
        super().__init__(name, params, {"right": params.right}, params.max_age)

    def driver_options(self, directory: Path) -> dict[str, Any]:
        return {"period": self.params.period}
