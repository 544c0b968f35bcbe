import itertools
import sys

import pytest

from hub.planning import registry
from hub.planning.limits import MAX_PARTICIPANTS, safe_text
from hub.planning.scenario_file import load
from schemas.errors import ScenarioError
from tests.hub.parts import Part, into, out, plan_of

pytestmark = pytest.mark.usefixtures("pendulum")

HEAD = "name: swinging\nstep: 1 ms\nparticipants:\n  one: {kind: pendulum, length: 80 mm}\n"
ALIASES = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 10)
)
MERGES = "m0: &m0 {k: x}\n" + "".join(
    f"m{i}: &m{i}\n  <<: [{', '.join([f'*m{i - 1}'] * 3)}]\n  k{i}: 1\n" for i in range(1, 30)
)
TEXTS = "a: &a " + "z" * 4_000 + "\nb: [" + ", ".join(["*a"] * 1_000) + "]\n"
DEPTHS = "a0: &a0 [1]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}]\n" for i in range(1, 40))


def rejected(tmp_path, text, *overrides):
    """Return what `load` says."""
    file = tmp_path / "session.yaml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ScenarioError) as caught:
        load(str(file), overrides)
    assert len(str(caught.value)) < 10_000
    return str(caught.value).replace(str(file), "FILE")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        pytest.param(HEAD + ALIASES, "20000 keys and values are not allowed, aliases", id="alias bomb"),
        pytest.param(HEAD + MERGES, "20000 keys and values are not allowed, aliases", id="merge bomb"),
        pytest.param(HEAD + TEXTS, "524288 characters are not allowed, aliases", id="texts by aliases"),
        pytest.param(HEAD + DEPTHS, "32 levels are not allowed, aliases", id="depth by aliases"),
        pytest.param(
            HEAD + "a: &a {<<: *a}\n", "FILE:5:4: nested too deeply: an alias", id="merge of itself"
        ),
        pytest.param(HEAD + "order: [" + "1, " * 100_000 + "1]\n", "FILE:5:", id="list of 300 kB"),
        pytest.param(HEAD + "order: [" + "1, " * 2_000_000 + "1]\n", "larger than 524288", id="list of 6 MB"),
        pytest.param(HEAD + "# " + "c" * 50_000_000, "larger than 524288 bytes", id="comment of 50 MB"),
        pytest.param(HEAD + "description: " + "c" * 5_000, "FILE:5:14: a text of 5000", id="long text"),
        pytest.param(HEAD + "order: " + "[" * 33 + "]" * 33, "FILE:5:39: nested too deeply", id="deep list"),
        pytest.param(HEAD + "order: " + "[" * 100_000, "nested too deeply: at most 32", id="deeper list"),
        pytest.param(HEAD + "order: [" + "1, " * 5_001 + "]", "more than 5000 items", id="many items"),
        pytest.param(HEAD + "window: " + "1" * 4_000, "FILE:5:9: a number of 4000", id="integer"),
        pytest.param(HEAD + "window: 0x" + "f" * 4_000, "FILE:5:9: a number of 4002", id="hexadecimal"),
        pytest.param(HEAD + "window: " + "1" * 100_000, "FILE:5:9: a text of 100000", id="long integer"),
        pytest.param("%YAML " + "9" * 5_000 + "\n---\n" + HEAD, "FILE: ", id="version of YAML"),
        pytest.param(HEAD + "? [a, b]\n: c\n", "FILE:5:3: a key must be a text", id="list as a key"),
        pytest.param(HEAD + "null: c\n", "FILE:5:1: a key must be a text", id="null as a key"),
        pytest.param(HEAD + 'order: ["\\ud800"]\n', "FILE:5:9: the character U+D800", id="lone surrogate"),
        pytest.param(HEAD + 'order: ["\\0"]\n', "FILE:5:9: the character U+0000", id="null character"),
        pytest.param(HEAD.encode() + b"order: [\xed\xa0\x80]\n", "cannot be read", id="surrogate in UTF-8"),
        pytest.param(HEAD + "order: !!int x\n", "FILE:5:8: not valid YAML: not a valid int", id="bad tag"),
        pytest.param(HEAD + "order: 2001-99-99\n", "FILE:5:8: not valid YAML: not a valid", id="bad date"),
        pytest.param(HEAD.replace("swinging", "s" * 65), "a name of 65 characters", id="long name"),
        pytest.param(HEAD.replace("80 mm", "'1 " + "(" * 3_000 + "m'"), "it has 3003 char", id="nested unit"),
        pytest.param(HEAD.replace("80 mm", "'1 " + "a" * 3_000 + "'"), "it has 3002 char", id="long unit"),
        pytest.param(
            HEAD + "".join(f"  p{i}: {{kind: pendulum}}\n" for i in range(MAX_PARTICIPANTS)),
            "FILE:4:3: participants: a session of 1001 participants; at most 1000",
            id="participants",
        ),
        pytest.param(
            HEAD + "".join(f"  p{i}: {{kind: pendulum, x: 1}}\n" for i in range(900)),
            "x: there is",
            id="errors",
        ),
        pytest.param(
            HEAD
            + "".join(f"  p{i}: {{kind: pendulum}}\n" for i in range(900))
            + "scene: {springs: {"
            + ", ".join(f"s{i}: {{stiffness: 1}}" for i in range(100))
            + "}}\n",
            "901 participants take this part of the scene",
            id="scene for many",
        ),
    ],
)
def test_what_is_too_large_is_rejected_with_its_place(tmp_path, text, expected):
    assert expected in rejected(tmp_path, text)


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("order=" + "[" * 10_000, "nested too deeply"),
        ("order=[" + "1, " * 30_000 + "]", "more than 5000 items"),
        ("order=&a [*a]", "inside its own anchor"),
        ("window=" + "1" * 4_000, "a number of 4000 characters"),
        ("window=" + "1" * 600_000, "the text has 600000 bytes"),
        ("participants.one.length=1 " + "(" * 3_000, "it has 3002 characters"),
        ("order={[a]: b}", "a key must be a text"),
        ('order="\\ud800"', "U+D800"),
        ("\udcff=1", "only printable characters"),
        ("order=\udcff", "the value is not valid YAML"),
        (".".join("a" * 100_000) + "=1", "32 parts"),
        ("connections." + "9" * 5_000 + "=1", "4096 characters"),
        ("connections." + "9" * 4_000 + "=1", "no '999"),
    ],
)
def test_an_override_has_the_same_limits(tmp_path, override, expected):
    message = rejected(tmp_path, HEAD + "connections: []\n", override)
    assert message.startswith("--set "), message
    assert expected in message
    assert message.isprintable() or "\n" in message


@pytest.mark.parametrize(
    "path", ["a" * 100_000 + ".yaml", "a/" * 50_000 + "b.yaml", "a\0b.yaml", "\udcff.yaml"], ids=range(4)
)
def test_a_name_that_no_file_can_have(path):
    with pytest.raises(ScenarioError, match=r"there is no scenario file|is not a path") as caught:
        load(path)
    str(caught.value).encode()
    assert len(str(caught.value)) < 1_000


def test_a_path_in_a_parameter_that_no_file_can_have(tmp_path, install_plugin):
    text = (
        "from pathlib import Path\nfrom pydantic import field_validator\nfrom hub.participant import Params\n"
        "from swing import Pendulum\n"
        "class FileParams(Params):\n    file: Path\n    @field_validator('file')\n    @classmethod\n"
        "    def _check(cls, value):\n        value.stat()\n        return value\n"
        "class Reader(Pendulum):\n    params_model = FileParams\n"
    )
    install_plugin("reading", {"trocar.engines": {"reader": "reading:Reader"}}, text=text)
    scenario = HEAD.replace("{kind: pendulum, length: 80 mm}", "{kind: reader, file: " + "f" * 4_000 + "}")
    assert "FILE:4:8: participants.one: a file cannot be read" in rejected(tmp_path, scenario)


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("hub.participant:Stepped", "is an abstract class: it does not define close"),
        ("hub.participant:Device", "is an abstract class: it does not define"),
        ("json.__main__:x", "'json.__main__' is a program, which runs when it is imported"),
        ("ends:x", "SystemExit"),
        ("m" * 4_000 + ":x", "a kind of 4002 characters; at most 200"),
        ("m" * 4_000, "unknown kind"),
    ],
    ids=range(6),
)
def test_a_kind_that_is_no_participant(tmp_path, install_plugin, kind, expected):
    install_plugin("ends", {}, text="raise SystemExit(7)")
    assert expected in rejected(tmp_path, HEAD.replace("pendulum", kind))


def test_a_class_without_parameters_is_abstract(install_plugin):
    install_plugin(
        "bare", {}, text="from swing import Pendulum\nclass Bare(Pendulum):\n    params_model = 3\n"
    )
    with pytest.raises(ScenarioError, match="does not define params_model"):
        registry.load("bare:Bare")


def counted(function):
    """Return the result of `function`, and the number of its calls and returns."""
    count = itertools.count()
    sys.setprofile(lambda *_: next(count))
    try:
        result = function()
    finally:
        sys.setprofile(None)
    return result, next(count)


def test_a_chain_of_many_participants_is_planned_with_calls_in_proportion():
    def calls(number):
        # in reverse, so that the order of stepping has to be found
        parts = [Part(f"p{i}", into(), out()) for i in reversed(range(number))]
        parts[-1] = Part("p0", out())
        connections = [f"p{i}.out -> p{i + 1}.in" for i in range(number - 1)]
        plan, count = counted(lambda: plan_of(*parts, connections=connections))
        assert plan.order == tuple(f"p{i}" for i in range(number))
        return count

    assert calls(1000) < 12 * calls(100)


def test_many_participants_of_one_kind_are_read_with_calls_in_proportion(tmp_path):
    def calls(number):
        file = tmp_path / f"{number}.yaml"
        file.write_text(
            "name: many\nstep: 1 ms\nscene: {length: 1}\nparticipants:\n"
            + "".join(f"  p{i}: {{kind: pendulum}}\n" for i in range(number))
        )
        loaded, count = counted(lambda: load(str(file)))
        assert len(loaded.params) == number
        return count

    calls(10)  # what is imported and cached at the first time
    assert calls(MAX_PARTICIPANTS) < 12 * calls(MAX_PARTICIPANTS // 10)


def test_a_text_is_shown_shortened_and_printable():
    assert safe_text("80 mm") == "80 mm"
    assert safe_text("a\x1b\ud800\nb") == "a\\x1b\\ud800\nb"
    assert safe_text("a" * 1_000, 10) == "aaaaa... (1000 characters) ...aaaaa"


def test_an_override_may_leave_participants_out_but_for_names_of_the_top_level(tmp_path):
    file = tmp_path / "two.yaml"
    file.write_text(HEAD + "  order: {kind: pendulum, length: 80 mm}\nduration: 1 ms\n")
    short = load(str(file), ["one.host=other", "order=[order, one]"]).scenario
    assert short.participants["one"].host == "other"
    assert short.order == ["order", "one"]
