"""Files that parameters name: regular ones alone, and for a recording those with recorded contents."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

from schemas import files
from schemas.files import Files, has_contents


def test_a_relative_path_starts_at_the_directory(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("a")
    assert Files(tmp_path).find(Path("a.txt")) == tmp_path / "a.txt"
    assert Files(tmp_path).find(Path("missing")) == tmp_path / "missing"


def test_a_pipe_and_a_device_are_never_read(tmp_path: Path) -> None:
    """A pipe made `view` hang, and /dev/zero cost 4.6 GB in 15 s."""
    os.mkfifo(tmp_path / "pipe")
    for path in (Path("pipe"), Path("/dev/zero"), Path()):
        with pytest.raises(ValueError, match="something else than regular files"):
            Files(tmp_path).find(path)
        assert not has_contents(tmp_path / path, [hashlib.sha256(b"").hexdigest()])


def test_of_a_recording_only_recorded_contents(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("a")
    known = Files(tmp_path, {hashlib.sha256(b"a").hexdigest()})
    assert known.find(Path("a.txt")) == tmp_path / "a.txt"
    (tmp_path / "b.txt").write_text("b")
    for path in ("b.txt", "missing"):
        with pytest.raises(ValueError, match="missing or has other contents"):
            known.find(Path(path))
    with pytest.raises(ValueError, match="network path"):
        known.find(Path("//machine/share"))


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.txt").write_text("too large")
    monkeypatch.setattr(files, "MAX_FILE_BYTES", 4)
    with pytest.raises(ValueError, match="has 9 bytes; at most 4 are read"):
        Files(tmp_path).find(Path("a.txt"))


def test_contents_are_hashed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.txt").write_text("a")
    hashed = list[Path]()
    file_hash = files.file_hash
    monkeypatch.setattr(files, "file_hash", lambda file: hashed.append(file) or file_hash(file))
    known = Files(tmp_path, {hashlib.sha256(b"a").hexdigest()})
    assert known.allows(Path("a.txt"))
    assert known.find(Path("a.txt")) == tmp_path / "a.txt"
    assert hashed == [tmp_path / "a.txt"]


def test_names_that_the_system_refuses(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    for name in ("a" * 5000, "loop", "zero\0byte"):
        assert not Files(tmp_path, ()).allows(Path(name))
    with pytest.raises(ValueError, match="cannot be read"):
        Files(tmp_path).find(Path("a" * 5000))
