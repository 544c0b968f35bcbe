"""The scene: what several participants have in common is stated once."""

import pytest

from hub.planning.scenario_file import load
from hub.recording.recording import Recording
from hub.session.launch import launch
from schemas.errors import ScenarioError

SCENE = """\
name: swinging
step: 1 ms
duration: 2 ms
scene:
  length: 80 mm
  springs:
    left: {stiffness: 3}
    right: {stiffness: 4}
participants:
  one: {kind: pendulum}
  two: {kind: pendulum, length: 0.5, springs: {right: {stiffness: 5}, top: {stiffness: 6}}}
  three: {kind: pendulum, springs: null}
"""

pytestmark = pytest.mark.usefixtures("pendulum")


@pytest.fixture
def write(tmp_path):
    def write(text):
        file = tmp_path / "scene.yaml"
        file.write_text(text)
        return str(file)

    return write


def springs(params):
    return {name: spring.stiffness for name, spring in params.springs.items()}


def test_every_participant_gets_the_scene_beneath_its_own_values(write):
    params = load(write(SCENE)).params
    assert [params[name].length for name in ("one", "two", "three")] == [0.08, 0.5, 0.08]
    assert springs(params["one"]) == {"left": 3, "right": 4}
    assert springs(params["two"]) == {"left": 3, "right": 5, "top": 6}  # entry by entry
    assert springs(params["three"]) == {}  # null keeps the scene's part out


def test_overrides_of_the_scene_and_of_one_participant(write):
    overrides = ["scene.springs.left.stiffness=7", "participants.one.springs.right.stiffness=8"]
    params = load(write(SCENE), overrides).params
    assert springs(params["one"]) == {"left": 7, "right": 8}
    assert springs(params["two"]) == {"left": 7, "right": 5, "top": 6}


def test_merge_keys_and_the_scene(write):
    text = SCENE.replace("one: {", "one: &one {").replace("three: {kind: pendulum, ", "three: {<<: *one, ")
    text = text.replace("  left:", "  left: &left").replace("springs: null", "springs: {top: *left}")
    assert springs(load(write(text)).params["three"]) == {"left": 3, "right": 4, "top": 3}


@pytest.mark.parametrize("scene", ["scene:\n", "scene: {}\n"])
def test_an_empty_scene_is_none(write, scene):
    text = f"name: swinging\nstep: 1 ms\n{scene}participants: {{one: {{kind: pendulum, length: 1}}}}\n"
    assert load(write(text)).params["one"].length == 1


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("left: {stiffness: 3", "left: {stiffness: -3", "7:23: participants.one.springs.left.stiffness: Inp"),
        ("left: {stiffness", "left: {stifness", "7:12: participants.one.springs.left.stifness: there is no"),
        ("length: 80 mm", "length: 80 kg", "5:11: participants.three.length: '80 kg' is not a quantity in m"),
        ("length: 0.5", "length: -0.5", "11:33: participants.two.length: Input should be greater than 0"),
        ("top: {stiffness: 6", "top: {stiffness: 0", "11:88: participants.two.springs.top.stiffness: Input"),
        ("  length: 80", "  lenght: 80", "5:11: scene.lenght: no participant has a parameter 'lenght'."),
        ("  length: 80", "  lenght: 80", "Did you mean 'length'? Known: length, solver, springs."),
    ],
)
def test_a_mistake_has_the_place_where_it_is_written(write, old, new, expected):
    assert old in SCENE
    with pytest.raises(ScenarioError) as raised:
        load(write(SCENE.replace(old, new)))
    assert expected in str(raised.value)


def test_a_mistake_in_an_override_of_the_scene_names_the_override(write):
    with pytest.raises(ScenarioError) as raised:
        load(write(SCENE), ["scene.length=-1"])
    problems = [f"participants.{name}.length: Input should be greater than 0" for name in ("one", "three")]
    assert [line.partition(" (got")[0] for line in str(raised.value).splitlines()] == [
        f"--set scene.length=-1: {problem}" for problem in problems
    ]


def test_an_override_of_the_scene_is_not_blamed_for_a_participants_own_mistake(write):
    file = write(SCENE.replace("length: 0.5", "length: -0.5"))
    with pytest.raises(ScenarioError) as raised:
        load(file, ["scene.length=2"])
    assert str(raised.value).startswith(f"{file}:11:33: participants.two.length: ")


@pytest.mark.parametrize("scene", ["[length]", "3", "''"])
def test_a_scene_that_is_no_mapping(write, scene):
    text = (
        f"name: swinging\nstep: 1 ms\nscene: {scene}\nparticipants: {{one: {{kind: pendulum, length: 1}}}}\n"
    )
    with pytest.raises(ScenarioError, match=r"3:8: scene: expected a mapping of parameters, got"):
        load(write(text))


def test_every_mistake_is_reported_at_once(write):
    text = SCENE.replace("step: 1 ms", "step: 0 ms").replace("  length: 80 mm", "  length: 80 mm\n  size: 1")
    with pytest.raises(ScenarioError) as raised:
        load(write(text.replace("stiffness: 6", "stiffness: 0")))
    places = [line.partition("scene.yaml")[2].partition(": ")[0] for line in str(raised.value).splitlines()]
    assert places == [":2:7", ":6:9", ":12:88"]


def test_a_part_may_belong_to_a_participant_of_an_unknown_kind(write):
    with pytest.raises(ScenarioError) as raised:
        load(write(SCENE.replace("one: {kind: pendulum}", "one: {kind: pendulm}") + "\n").replace("", ""))
    assert "unknown kind 'pendulm'" in str(raised.value)
    text = SCENE.replace("one: {kind: pendulum}", "one: {kind: pendulm}").replace(
        "scene:", "scene:\n  size: 1"
    )
    with pytest.raises(ScenarioError) as raised:
        load(write(text))
    assert "scene.size" not in str(raised.value)


def test_a_recorded_scenario_holds_the_values_where_they_are_used(write, tmp_path):
    loaded = load(write(SCENE))
    launch(loaded, record=tmp_path / "recording").run()
    recorded = Recording(tmp_path / "recording").scenario()
    assert recorded == loaded.scenario
    two = recorded.participants["two"].params
    assert two == {
        "length": 0.5,
        "springs": {"left": {"stiffness": 3}, "right": {"stiffness": 5}, "top": {"stiffness": 6}},
    }
