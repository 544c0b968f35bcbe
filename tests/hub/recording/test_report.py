import builtins
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hub.recording.recorder import Recorder
from hub.recording.recording import Recording
from hub.recording.report import report
from schemas.codec import encode
from schemas.errors import MissingExtraError, RecordingError
from schemas.ros import Header, Time
from schemas.trocar_msgs import AckMessage, CouplingEnergy, SessionStatus
from tests.hub.sample_session import ATTACHMENTS, SCENARIO, STEP_NS, write_session


class Page(HTMLParser):
    """Checks that tags are balanced, and keeps what the tests look at."""

    VOID = ("meta", "link", "br", "img", "input", "hr")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words = ""
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    directory = tmp_path_factory.mktemp("session")
    write_session(directory / "run", 0.5)
    report(Recording(directory / "run"), directory / "report.html")
    return (directory / "report.html").read_text()


def test_one_page_that_loads_nothing(text: str) -> None:
    page = Page(text)
    assert not [tag for tag, _ in page.tags if tag in ("script", "link", "img", "iframe", "object")]
    fetched = [
        value
        for _, attrs in page.tags
        for name, value in attrs.items()
        if name in ("src", "href", "xlink:href", "srcset") and value
    ]
    assert all(value.startswith("#") for value in fetched)
    assert "@import" not in text
    assert re.findall(r"url\((?!#)", text) == []


def test_numbers_and_plots(text: str) -> None:
    page = Page(text)
    for word in (
        "palpation",
        "0.500 s",
        "peak force, robot/PSM1/probe",
        "energy residual",
        "mujoco",
        "4.0.0",
        "/engine/robot/ack",
    ):
        assert word in page.words
    images = [attrs for tag, attrs in page.tags if tag == "svg"]
    assert len(images) == 8
    assert all(
        attrs["role"] == "img" and attrs["aria-label"] and attrs["viewbox"] and "width" not in attrs
        for attrs in images
    )
    assert "3 contacts" in page.words


def test_it_follows_the_readers_theme(text: str) -> None:
    assert "prefers-color-scheme: dark" in text
    assert "var(--series-0)" in text
    assert not re.findall(r"#c0000\d|#101112|#d0d1d2", text)


@pytest.mark.long
def test_words_of_a_scenario_are_no_markup(text: str) -> None:
    assert "PSM1 &lt;and&gt; retreats" in text
    assert "<and>" not in text


@pytest.mark.long
def test_the_same_recording_gives_the_same_page(tmp_path: Path) -> None:
    write_session(tmp_path / "run", 0.1)
    for name in ("a.html", "b.html"):
        report(Recording(tmp_path / "run"), tmp_path / name)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_a_session_that_ended_at_once(tmp_path: Path) -> None:
    Recorder(tmp_path / "run", attachments=ATTACHMENTS).close()
    report(Recording(tmp_path / "run"), tmp_path / "x.html")
    assert "communication step" in Page((tmp_path / "x.html").read_text()).words


def test_what_cannot_be_reported(tmp_path: Path) -> None:
    Recorder(tmp_path / "other", attachments={}).close()
    with pytest.raises(RecordingError, match="holds no scenario"):
        report(Recording(tmp_path / "other"), tmp_path / "x.html")
    Recorder(tmp_path / "run", attachments=ATTACHMENTS).close()
    with pytest.raises(RecordingError, match="cannot write the report"):
        report(Recording(tmp_path / "run"), tmp_path / "missing" / "x.html")


def test_without_matplotlib(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_session(tmp_path / "run", 0.05)
    original = builtins.__import__

    def without(name: str, *args: Any) -> Any:
        if name.startswith("matplotlib"):
            raise ImportError(name)
        return original(name, *args)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtraError, match=r"pip install 'trocar\[report\]'"):
        report(Recording(tmp_path / "run"), tmp_path / "x.html")


HOSTILE = (
    r"""</title></pre></svg></script><script>alert(1)</script><img src=x onerror=alert(2)>"'>\1\g<0>$x$ """
)


def _hostile(directory: Path) -> Path:
    """Write a session in which every text that the schema allows is markup; its bond is a stranger's too."""
    bond = f"PSM1/{HOSTILE}"
    scenario = {
        **SCENARIO,
        "description": HOSTILE,
        "participants": {name: {"kind": HOSTILE, HOSTILE: HOSTILE} for name in ("robot", "tissue")},
        "bonds": [{"motion": {"participant": "robot", "port": bond}, "force": f"tissue.{HOSTILE}"}],
        "measure": {},
    }
    texts = {HOSTILE: HOSTILE}
    attachments = {
        "scenario.yaml": HOSTILE.encode(),
        "scenario.json": json.dumps(scenario).encode(),
        "versions.json": json.dumps(texts).encode(),
        "files.json": json.dumps(texts).encode(),
    }
    now = SessionStatus(
        session=HOSTILE,
        run=1,
        state=HOSTILE,
        step=0,
        sim_time_ns=0,
        real_time_factor=1.0,
        late_steps=0,
        dropped_messages=0,
        participants=[],
        detail=HOSTILE,
    )
    file = directory / "<img src=x onerror=alert(3)>"
    with Recorder(file, attachments=attachments) as recorder:
        status = recorder.add_channel("/hub/status", SessionStatus.ros_type)
        ack = recorder.add_channel("/engine/robot/ack", AckMessage.ros_type)
        energy = recorder.add_channel(f"/hub/energy/robot/{bond}", CouplingEnergy.ros_type)
        odd = recorder.add_channel(f"/engine/robot/out/{HOSTILE}", CouplingEnergy.ros_type)
        for step in range(1, 5):
            time_ns = step * STEP_NS
            spent = np.array([1000 * step], np.uint64)
            done = AckMessage(
                run=1, epoch=0, step=step, state_hash=spent, compute_ns=spent, work_j=np.zeros(1)
            )
            recorder.write(ack, time_ns, encode(done))
            works = {"motion_work_j": 1e-3 * step, "force_work_j": 2e-3 * step, "residual_j": 1e-3 * step}
            book = CouplingEnergy(header=Header(stamp=Time.from_ns(time_ns)), bond=HOSTILE, **works)
            recorder.write(energy, time_ns, encode(book))
            recorder.write(odd, time_ns, encode(book))
            recorder.write(status, time_ns, encode(now.model_copy(update={"step": step})))
    return file


@pytest.mark.long
def test_nothing_in_a_strangers_recording_is_markup(tmp_path: Path, text: str) -> None:
    """The page of a hostile recording has no element and no attribute that another page has not."""
    report(Recording(_hostile(tmp_path)), tmp_path / "x.html")
    page, usual = Page((tmp_path / "x.html").read_text()), Page(text)
    known = {(tag, name) for tag, attributes in usual.tags for name in ("", *attributes)}
    assert {(tag, name) for tag, attributes in page.tags for name in ("", *attributes)} <= known
    assert page.words.count("<script>alert(1)</script>") >= 8
    assert "<img src=x onerror=alert(3)>" in page.words
    assert "<script" not in Recording(tmp_path / "<img src=x onerror=alert(3)>")._repr_html_()


@pytest.mark.long
def test_a_browser_runs_and_loads_nothing_of_the_page(text: str) -> None:
    page = Page(text)
    policy = {
        "http-equiv": "Content-Security-Policy",
        "content": "default-src 'none'; style-src 'unsafe-inline'",
    }
    assert ("meta", policy) in page.tags
