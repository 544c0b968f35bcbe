from devices.openhaptics.device import Touch
from devices.openhaptics.params import TouchParams
from devices.simulated_touch.device import SimulatedTouch
from devices.simulated_touch.params import SimulatedTouchParams
from schemas.ports import Port


def _without_clock(ports: tuple[Port, ...]) -> list[Port]:
    return sorted((port.model_copy(update={"clock": "wall"}) for port in ports), key=lambda port: port.name)


def test_a_simulated_stylus_may_stand_for_a_real_one() -> None:
    styluses = {"right": {}, "left": {"device": "left"}}
    real = Touch("console", TouchParams.model_validate({"styluses": styluses, "max_age": "50 ms"}))
    paths = {name: {"path": [{"at": 0}]} for name in styluses}
    simulated = SimulatedTouch(
        "console", SimulatedTouchParams.model_validate({"styluses": paths, "max_age": "50 ms"})
    )
    assert _without_clock(real.ports) == _without_clock(simulated.ports)
    assert len(real.ports) == 12
