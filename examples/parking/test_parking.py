from trocar_example_parking import Parking, ParkingParams

from trocar import check_engine

POSE = [0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0]


def test_it_keeps_the_contract():
    params = ParkingParams(arms={"PSM1": {}}, objects={"needle": {}}, spot=(0.0, 0.0, 0.0))
    inputs = {"PSM1/measured_cp": POSE, "needle/pose": POSE, "needle/held_by": [1.0]}
    check_engine(lambda: Parking("task", params), period_ns=10_000_000, inputs=inputs)
