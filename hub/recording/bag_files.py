"""Where a recording is, where its pages and pictures go, and errors of reading it."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from schemas.errors import RecordingError

__all__ = ["bag_file", "default_output", "reading_errors"]


def bag_file(path: Path) -> Path:
    """Return the MCAP file at `path`: the file itself, or the file in a rosbag2 directory.

    Raises RecordingError if there is not exactly one file.
    """
    if path.is_dir():
        files = sorted(file for file in path.glob("*.mcap") if file.is_file())  # a pipe would never end
        if len(files) != 1:
            raise RecordingError(
                f"'{path}' holds {len(files)} .mcap files; name a recording's directory, which holds one, or"
                " a file"
            )
        return files[0]
    if not path.is_file():
        raise RecordingError(f"no recording at '{path}'; name a recording's directory or an .mcap file")
    return path


def default_output(recording: Path, ending: str) -> Path:
    """Return the default output beside a recording: `x.png` for the recordings `x` and `x.mcap`.

    Raises RecordingError if there is a link: a file beside a stranger's recording may be the stranger's, and
    lead to any file of the user.
    """
    place = recording.resolve() if recording.name in ("", "..") else recording
    path = place.with_name(f"{place.stem if place.is_file() else place.name}{ending}")
    if path.is_symlink():
        raise RecordingError(f"'{path}' is a link, through which nothing is written: name another --output")
    return path


@contextmanager
def reading_errors(file: Path) -> Generator[None]:
    """Turn the parsers' errors at damaged bytes into a RecordingError with the name of `file`."""
    try:
        yield
    except (RecordingError, GeneratorExit):
        raise
    except OSError as error:
        raise RecordingError(f"cannot read '{file}': {error.strerror}") from error
    except Exception as error:  # struct.error, KeyError, ValueError, and those of zstd and lz4
        raise RecordingError(
            f"'{file}' is damaged ({type(error).__name__}: {error}); `trocar recover {file}` saves what is"
            " whole"
        ) from error
