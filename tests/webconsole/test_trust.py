"""The page of a recording whose files have changed since."""

from contextlib import ExitStack

import pytest

import trocar
from robots.dvrk import arm_bodies, ecm
from robots.dvrk.own_dynamics import BodyInertia, JointLosses, OwnDynamics
from tests.webconsole.conftest import finish
from webconsole.console import Console
from webconsole.library import Library
from webconsole.pilot import Pilots
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


@pytest.fixture
def changed(tmp_path):
    """A recording in a directory of its own, with a file that is changed when it is called."""
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
    return tmp_path / "own"


def test_a_scene_of_a_changed_file_is_drawn_with_trust_alone(changed):
    (note,) = stage(Recorded(changed)).notes
    assert "ecm.yaml', which is missing or has other contents than those recorded" in note
    assert "allow it with --trust" in note
    trusted = stage(Recorded(changed, trust=True))
    assert ("robot" in trusted.scenes, trusted.notes) == (True, [])


def test_a_recording_opened_by_its_name_is_not_trusted(changed):
    """Nor is one that the server trusts where it was named on the command line."""

    async def body():
        with ExitStack() as stack:
            own = Console(Recorded(changed, trust=True), Pilots())
            library = Library(changed.parent, own, stack)
            return [await (await library.console(name)).stage() for name in (None, "own")]

    trusted, opened = finish(body())
    assert (trusted.notes, list(trusted.scenes)) == ([], ["robot"])
    assert "allow it with --trust" in opened.notes[0]
    assert not opened.scenes
