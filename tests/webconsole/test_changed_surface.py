"""A cut on the page: its frames, and the geometry in a browser."""

import json
from contextlib import contextmanager

import numpy as np
import pytest

from hub.participant import Params, signal_out
from hub.participant.view import TISSUE_COLOURS
from schemas.codec import encode
from schemas.errors import MessageError
from schemas.scenario import Scenario
from schemas.soft_surface import FaceKind, SoftSurface
from schemas.trocar_msgs import SoftBodyState, SurfaceChange, SurfaceFilm
from schemas.vectors import VectorCodec
from tests.engines.tissue.cut_block import CutBlock
from tests.webconsole.conftest import served
from tests.webconsole.recorded_cut import STEP_NS, film_at, nodes_at, write_cut
from tests.webconsole.test_browser import Person
from webconsole.commands import Show
from webconsole.console import Console
from webconsole.frame import SectionKind
from webconsole.new_sections import NewSections
from webconsole.pilot import Pilots
from webconsole.recorded import Recorded
from webconsole.source import Outlet, Value
from webconsole.stage import Stage

SCENARIO = Scenario.model_validate(
    {"name": "cut", "step": "1 ms", "duration": "1 s", "participants": {"tissue": {"kind": "toys:Busy"}}}
)
OUTLETS = (
    Outlet("tissue", signal_out("block/nodes", SoftBodyState)),
    Outlet("tissue", signal_out("block/surface", SurfaceChange)),
    Outlet("tissue", signal_out("block/film", SurfaceFilm)),
)
PARTS = "(3 * 4 ** trocar.scene.surfaces[0].divided.length)"
"""Corners of the triangles that a face is divided into."""
GROUPS = f"""
trocar.scene.surfaces[0].mesh.geometry.groups.map((group) => [group.materialIndex, group.count / {PARTS}])
""".strip()


@pytest.fixture(scope="module")
def cut_recording(tmp_path_factory):
    directory = tmp_path_factory.mktemp("cut") / "palpation"
    return directory, write_cut(directory)


@contextmanager
def stage_of(directory):
    recorded = Recorded(directory)
    console = Console(recorded, Pilots())
    yield NewSections(console), Stage(recorded.scenario, recorded.outlets, recorded.params)


def kinds(sections):
    return [one.kind for one in sections if one.kind in (SectionKind.SURFACE, SectionKind.CHANGE)]


def test_a_page_gets_the_change_once_and_again_after_a_seek(cut_recording):
    directory, block = cut_recording
    with stage_of(directory) as (sections, stage):
        show = Show(do="show", pictures=False, numbers=[])
        assert stage.changes == {"tissue.block/nodes": "tissue.block/surface"}
        assert "tissue.block/surface" in stage.shown
        first = sections.make(stage, show, 0)
        assert kinds(first) == [SectionKind.SURFACE, SectionKind.CHANGE]
        assert kinds(sections.make(stage, show, STEP_NS)) == []
        late = sections.make(stage, show, 20 * STEP_NS)
        (change,) = [one for one in late if one.kind == SectionKind.CHANGE]
        full = block.surface.change("block", 0)
        assert len(change.content) == 4 + 17 * len(full.slots) + 4 * len(full.origins)
        assert kinds(sections.make(stage, show, 21 * STEP_NS)) == []
        (back,) = [one for one in sections.make(stage, show, 0) if one.kind == SectionKind.CHANGE]
        assert back.content == b""
        assert not sections.problems


def test_a_page_gets_the_blood_when_it_changes(cut_recording):
    directory, block = cut_recording
    with stage_of(directory) as (sections, stage):
        show = Show(do="show", pictures=False, numbers=[])
        assert stage.films == {"tissue.block/nodes": "tissue.block/film"}

        def films(step):
            made = sections.make(stage, show, step * STEP_NS)
            return [one.content for one in made if one.kind == SectionKind.FILM]

        (dry,) = films(0)
        assert len(dry) == 24
        assert films(1) == []
        (wet,) = films(20)
        assert len(wet) == 24 + 5 * len(block.part(0.0))
        assert films(21) == []
        assert films(0) == [dry]
        assert not sections.problems


def test_a_strangers_film_is_a_problem_of_its_surface_alone():
    stage = Stage(SCENARIO, OUTLETS, lambda _: Params())
    film = film_at(CutBlock(np.array([0.08, 0.06, 0.02]), 60), 20)
    assert stage.film("tissue.block/nodes", Value(0, encode(film))).content
    damaged = film.model_copy(update={"nodes": film.nodes[::-1].copy()})
    with pytest.raises(MessageError, match="ascending"):
        stage.film("tissue.block/nodes", Value(0, encode(damaged)))


def test_a_page_gets_the_smoke_of_a_surface():
    port = signal_out("block/smoke", unit="g/s")
    stage = Stage(SCENARIO, (*OUTLETS, Outlet("tissue", port)), lambda _: Params())
    assert stage.smokes == {"tissue.block/nodes": "tissue.block/smoke"}
    assert "tissue.block/smoke" in stage.shown
    value = Value(0, VectorCodec(port).encode(np.array([0.004]), 0))
    section = stage.smoke("tissue.block/nodes", value)
    assert (section.kind, np.frombuffer(section.content, "<f4")[0]) == (SectionKind.SMOKE, np.float32(0.004))


def test_a_strangers_change_is_a_problem_of_its_surface_alone():
    stage = Stage(SCENARIO, OUTLETS, lambda _: Params())
    block = CutBlock(np.array([0.08, 0.06, 0.02]), 60)
    first = SoftSurface.of_first(nodes_at(block, 0))
    block.cut(0.012)
    change = block.surface.change("block", 0)
    name = "tissue.block/nodes"
    assert stage.change(name, first, Value(0, encode(change))).content
    damaged = change.model_copy(update={"faces": change.faces + 1000})
    with pytest.raises(MessageError, match="a face with a node outside"):
        stage.change(name, first, Value(0, encode(damaged)))


def test_colours_are_described_by_kind():
    stage = Stage(SCENARIO, OUTLETS, lambda _: Params())
    (surface,) = stage.describe()["surfaces"]
    assert len(surface["colours"]) == 1 + len(TISSUE_COLOURS) == len(FaceKind)


def test_the_browser_draws_the_cut_and_the_whole_block_before(browser, cut_recording):
    directory, block = cut_recording
    count = {kind: int((block.surface.kinds == kind).sum()) for kind in FaceKind}
    with served(Recorded(directory)) as server:
        person = Person(browser, f"http://127.0.0.1:{server.port}{server.gate.invite('viewer')}")
        person.sees("Boolean(trocar.scene?.placed && trocar.scene.surfaces[0]?.mesh)")
        whole = f"JSON.stringify({GROUPS}) === '[[0,{len(block.mesh.triangles)}]]'"
        groups = [[int(kind), count[kind]] for kind in FaceKind if count[kind]]
        cut = f"JSON.stringify({GROUPS}) === '{json.dumps(groups).replace(' ', '')}'"
        instant = person.page.get_by_role("slider", name="Instant of the recording")
        instant.fill("0.4")
        person.sees(cut)
        colours = "trocar.scene.surfaces[0].mesh.geometry.attributes.color.array"
        assert person.page.evaluate(f"{colours}.every((part) => part >= 0 && part < 10)")
        assert person.page.evaluate(f"{colours}[1] < 0.3")  # blood lets no green through
        positions = "trocar.scene.surfaces[0].mesh.geometry.attributes.position.array"
        assert person.page.evaluate(f"{positions}.every(Number.isFinite)")
        instant.fill("0")
        person.sees(whole)
        person.sees(f"{colours}.every((part) => Math.abs(part - 1) < 1e-3)")
        instant.fill("0.4")
        person.sees(cut)
