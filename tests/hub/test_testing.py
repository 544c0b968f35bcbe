"""`hub.testing` itself: our own participants pass, and each kind of breach is named."""

from controllers.teleoperation import Teleoperation, TeleoperationParams
from devices.scripted.device import ScriptedDevice, ScriptedParams
from engines.bullet.engine import BulletEngine, BulletParams
from engines.mujoco.engine import MujocoEngine
from engines.mujoco.params import MujocoParams
from hub.scenario_file import installed_scenarios
from hub.testing import check_device, check_engine
from robots.dvrk import psm

MS = 1_000_000


def test_mujoco():
    params = MujocoParams.model_validate({"arms": {"PSM1": {}}})
    command = [*psm.HOME[:2], psm.HOME[2] + 0.01, *psm.HOME[3:]]
    check_engine(
        lambda: MujocoEngine("robot", params),
        period_ns=MS,
        inputs={"PSM1/servo_jp": command, "PSM1/probe/wrench": [0.1, 0.2, 0.5, 0, 0, 0]},
    )


def test_bullet():
    params = BulletParams.model_validate(
        {"organs": {"block": {"size": ["80 mm", "60 mm", "20 mm"], "young_modulus": "10 kPa", "nodes": 75}}, "probes": {"probe": {}}}
    )
    check_engine(
        lambda: BulletEngine("tissue", params),
        period_ns=4 * MS,
        inputs={"probe/pose": [0, 0, 5.2e-3, 0, 0, 0, 1], "probe/twist": [0.001, 0, -0.02, 0, 0, 0]},
    )


def test_teleoperation():
    params = TeleoperationParams()
    check_engine(lambda: Teleoperation("teleop", params), period_ns=4 * MS)


def test_scripted():
    configs = installed_scenarios()["palpation"].parent
    params = ScriptedParams.model_validate({"samples": "data/palpation_hand"}, context={"directory": configs})
    check_device(lambda: ScriptedDevice("stylus", params))
