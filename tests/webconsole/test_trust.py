"""The page of a recording whose files have changed since."""

import trocar
from robots.dvrk import arm_bodies, ecm
from robots.dvrk.own_dynamics import BodyInertia, JointLosses, OwnDynamics
from webconsole.recorded import Recorded
from webconsole.stage import Stage

SCENARIO = """
name: own
step: 5 ms
duration: 20 ms
participants:
  robot: {kind: mujoco, arms: {ECM: {dynamics: ecm.yaml}}}
"""


def stage(source):
    return Stage(source.scenario, source.outlets, source.params)


def test_a_scene_of_a_changed_file_is_drawn_with_trust_alone(tmp_path):
    bodies = {
        name: BodyInertia(mass=body.mass, centre=body.centre, tensor=body.tensor)
        for name, body in arm_bodies.ecm().items()
    }
    losses = JointLosses(armature=0.0, stiffness=1e-3, offset=0.0, viscous=0.3)
    own = OwnDynamics(
        instrument="endoscope", bodies=bodies, joints=dict.fromkeys(ecm.JOINT_NAMES, losses), discs=[]
    )
    (tmp_path / "ecm.yaml").write_text(own.text())
    (tmp_path / "own.yaml").write_text(SCENARIO)
    trocar.run(tmp_path / "own.yaml", record=tmp_path / "own", one_host=True)
    assert "robot" in stage(Recorded(tmp_path / "own")).scenes
    (tmp_path / "ecm.yaml").write_text(f"# changed\n{own.text()}")
    (note,) = stage(Recorded(tmp_path / "own")).notes
    assert "ecm.yaml', which is missing or has other contents than those recorded" in note
    assert "allow it with --trust" in note
    trusted = stage(Recorded(tmp_path / "own", trust=True))
    assert ("robot" in trusted.scenes, trusted.notes) == (True, [])
