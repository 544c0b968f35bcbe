"""A sphere on the faces of a block: dragged over them, and beside held nodes."""

import numpy as np

from tests.engines.fem.rig import BLOCK, FemRig, params

RADIUS = 1.5e-3
HALF_HELD = {
    **BLOCK,
    "anchors": [
        {"surface": "bottom"},
        {"box": {"low": ["-1 m", "-1 m", "-1 mm"], "high": ["0.1 mm", "1 m", "1 mm"]}},
    ],
}
"""A block of which half the top is held, too."""


def test_the_force_stays_bounded_where_a_sphere_comes_to_the_held_nodes():
    depth, forces = RADIUS - 0.5e-3, []
    with FemRig(params(HALF_HELD, {"radius": RADIUS}), start=(6e-3, 1e-3, depth)) as rig:
        rig.hold(0.05)
        for x in np.linspace(6e-3, 0.0, 25):
            rig.move((x, 1e-3, depth), 0.01)
            forces.extend(np.linalg.norm(np.array(rig.wrenches[-10:])[:, :3], axis=1))
    assert 1.0 < max(forces) < 5.0


def test_the_force_of_a_dragged_sphere_changes_smoothly_from_face_to_face():
    block, radius, depth = {**BLOCK, "nodes": 800}, 3e-3, 1.5e-3
    with FemRig(params(block, {"radius": radius}), start=(-3e-3, 1e-3, radius)) as rig:
        rig.move((-3e-3, 1e-3, radius - depth), 0.3)
        rig.hold(0.05)
        pressed = rig.wrenches[-1][2]
        rig.move((3e-3, 1e-3, radius - depth), 6e-3 / 25e-3)
        dragged = np.array(rig.wrenches[-240:])[:, 2]
    assert pressed > 0.03
    np.testing.assert_allclose(dragged, pressed, rtol=0.2)  # the mesh is uneven
    assert np.abs(np.diff(dragged)).max() < 0.02 * pressed
