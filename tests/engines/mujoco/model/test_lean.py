"""A lean arm moves as the whole one does, and reports the positions of the whole model."""

import mujoco
import numpy as np
import pytest

from engines.mujoco import model
from engines.mujoco.model.lean import lean
from engines.mujoco.params import SceneParams

SCENE = SceneParams.model_validate(
    {
        "arms": {"PSM1": {"instrument": "LARGE_NEEDLE_DRIVER_400006", "start": [0, 0.2, 0.12, 0, 0, 0]}},
        "looks": False,
    }
)


def test_the_leading_joint_carries_its_linkage():
    whole = model.build(SCENE)
    light, positions = lean(model.spec(SCENE), SCENE)
    assert whole.nv - light.nv == 5
    full, data = mujoco.MjData(whole), mujoco.MjData(light)
    model.place(whole, full, SCENE.arms)
    model.place(light, data, SCENE.arms)
    assert positions @ data.qpos == pytest.approx(full.qpos)
    data.qpos[:2] = 0.4, -0.5  # elsewhere than where the inertia was taken, at the same insertion
    full.qpos[:] = positions @ data.qpos
    inertia, all_inertia = np.zeros((light.nv, light.nv)), np.zeros((whole.nv, whole.nv))
    for one, its, matrix in (light, data, inertia), (whole, full, all_inertia):
        mujoco.mj_forward(one, its)
        mujoco.mj_fullM(one, its, matrix)
    to_all = positions  # of an arm without free objects, velocities go as positions do
    pitch = int(light.joint("PSM1/pitch").dofadr[0])
    assert inertia[pitch, pitch] == pytest.approx((to_all.T @ all_inertia @ to_all)[pitch, pitch])
