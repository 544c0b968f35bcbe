"""Pictures of a recording on the page: an instant before the first one has none."""

from tests.webconsole.recorded_scene import write_scene
from webconsole.commands import Show
from webconsole.console import Console
from webconsole.frame import SectionKind
from webconsole.new_sections import NewSections
from webconsole.pilot import Pilots
from webconsole.recorded import Recorded
from webconsole.stage import Stage


def test_before_the_first_picture_the_page_is_told_that_there_is_none(tmp_path):
    write_scene(tmp_path / "scene", steps=4)
    recorded = Recorded(tmp_path / "scene")
    sections = NewSections(Console(recorded, Pilots()))
    stage = Stage(recorded.scenario, recorded.outlets, recorded.params)

    def sizes(at_ns):
        made = sections.make(stage, Show(do="show", pictures=True, numbers=[]), at_ns)
        return [len(one.content) > 0 for one in made if one.kind == SectionKind.PICTURE]

    assert sizes(-1) == []
    assert sizes(0) == [True, True]
    assert sizes(0) == []
    assert sizes(-1) == [False, False]
    assert sizes(-1) == []
    assert sizes(0) == [True, True]
