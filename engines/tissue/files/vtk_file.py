"""Reads legacy .vtk files (ASCII or binary, versions 1 to 5) of unstructured grids."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engines.tissue.meshing.tet_mesh import Indices
from schemas.vectors import Vector

__all__ = ["parse_vtk", "read_vtk"]

_TETRA = 10
"""VTK_TETRA, vtkCellType.h."""

_TYPES = {
    "float": ">f4",
    "double": ">f8",
    "int": ">i4",
    "unsigned_int": ">u4",
    "long": ">i8",
    "vtktypeint64": ">i8",
    "vtktypeint32": ">i4",
}
"""Number types of binary files, big-endian (The VTK User's Guide, 11th edition, file formats)."""

_LARGEST_FILE = 64_000_000
"""Bytes; a mesh of a few thousand nodes has less than a hundredth."""


def read_vtk(path: Path) -> tuple[Vector, Indices]:
    """Return the nodes, shape (n, 3), in the file's unit, and the tetrahedra, shape (m, 4), as in the file.

    Raises ValueError, naming the file, for a file without a tetrahedral mesh.
    """
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise ValueError(f"has more than {_LARGEST_FILE // 1_000_000} MB")
        if not path.is_file():
            raise ValueError("is no file")  # a pipe or a device has no end
        return parse_vtk(path.read_bytes())
    except OSError as error:
        raise ValueError(f"mesh {path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise ValueError(f"mesh {path}: {error}") from error


def parse_vtk(content: bytes) -> tuple[Vector, Indices]:
    """Return the nodes, shape (n, 3), and the tetrahedra, shape (m, 4), of a file's bytes.

    Raises ValueError for a file without a tetrahedral mesh.
    """
    return _Reader(content).mesh()


class _Reader:
    """Walks through the bytes of a file, line by line or number by number."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        self._at = 0
        magic, _, encoding = self._line(), self._line(), self._line().upper()
        if not magic.startswith("# vtk DataFile Version"):
            raise ValueError("is not a legacy .vtk file: it does not begin with '# vtk DataFile Version'")
        if encoding not in ("ASCII", "BINARY"):
            raise ValueError(f"its third line is '{encoding[:40]}', not ASCII or BINARY")
        self._binary = encoding == "BINARY"

    def mesh(self) -> tuple[Vector, Indices]:
        """Return nodes and tetrahedra."""
        nodes: Vector | None = None
        cells: list[Indices] | None = None
        types: Indices | None = None
        while self._at < len(self._content) and (nodes is None or cells is None or types is None):
            words = self._line().split()
            keyword = words[0].upper() if words else ""
            if keyword == "DATASET" and words[1:] != ["UNSTRUCTURED_GRID"]:
                raise ValueError(f"holds a dataset '{' '.join(words[1:])[:40]}', not UNSTRUCTURED_GRID")
            if keyword == "POINTS":
                nodes = self._numbers(
                    3 * self._count(words, 1), words[2].lower() if len(words) > 2 else ""
                ).reshape(-1, 3)
            elif keyword == "CELLS":
                cells = self._cells(words)
            elif keyword == "CELL_TYPES":
                types = self._read_integers(self._count(words, 1), "int")
        if nodes is None or cells is None or types is None:
            missing = [
                name
                for name, part in (("POINTS", nodes), ("CELLS", cells), ("CELL_TYPES", types))
                if part is None
            ]
            raise ValueError(f"has no {', '.join(missing)}")
        others, counts = np.unique(types[types != _TETRA], return_counts=True)
        if len(others) or len(types) != len(cells) or any(len(cell) != 4 for cell in cells):
            found = ", ".join(
                f"{count} of type {kind}"
                for kind, count in zip(others.tolist(), counts.tolist(), strict=True)
            )
            others_found = f"there are {found}" if found else "there are some with other numbers of nodes"
            raise ValueError(
                f"all cells must be tetrahedra (VTK type {_TETRA}, four nodes each), but {others_found}:"
                " export the volume alone"
            )
        return nodes, np.array(cells, np.int64).reshape(-1, 4)

    def _cells(self, words: list[str]) -> list[Indices]:
        """Return the nodes of every cell; since version 5 a list of offsets precedes the nodes."""
        count, size = self._count(words, 1), self._count(words, 2)
        if self._content[self._at : self._at + 40].lstrip().startswith(b"OFFSETS"):
            offsets = self._read_integers(count, self._kind("OFFSETS"))
            return np.split(self._read_integers(size, self._kind("CONNECTIVITY")), offsets[1:-1])
        flat, cells, at = self._read_integers(size, "int"), list[Indices](), 0
        while at < size and len(cells) < count:
            cells.append(flat[at + 1 : at + 1 + flat[at]])
            at += 1 + max(int(flat[at]), 0)
        return cells

    def _line(self) -> str:
        end = self._content.find(b"\n", self._at)
        end = len(self._content) if end < 0 else end
        line, self._at = self._content[self._at : end], end + 1
        return line.decode("ascii", "replace").strip()

    def _kind(self, keyword: str) -> str:
        """Return the type of the numbers after the next non-blank line.

        Raises ValueError unless the line begins with `keyword`.
        """
        while self._at < len(self._content):
            words = self._line().split()
            if len(words) == 2 and words[0] == keyword:
                return words[1].lower()
            if words:
                break
        raise ValueError(f"has no {keyword} where it should")

    def _count(self, words: list[str], place: int) -> int:
        if len(words) <= place or not words[place].isdigit():
            raise ValueError(f"the line '{' '.join(words)[:60]}' does not state how many numbers follow")
        count = int(words[place])
        if count > len(self._content):
            raise ValueError("ends too early")
        return count

    def _read_integers(self, count: int, kind: str) -> Indices:
        numbers = self._numbers(count, kind)
        if not (np.abs(numbers) < _LARGEST_FILE).all():
            raise ValueError("holds something else where numbers of nodes should be")
        return numbers.astype(np.int64)

    def _numbers(self, count: int, kind: str) -> NDArray[np.float64]:
        if self._binary:
            if kind not in _TYPES:
                raise ValueError(f"holds numbers of type '{kind[:40]}'; known: {', '.join(_TYPES)}")
            size = count * int(_TYPES[kind][-1])
            part, self._at = self._content[self._at : self._at + size], self._at + size
            if len(part) < size:
                raise ValueError("ends too early")
            return np.frombuffer(part, _TYPES[kind]).astype(np.float64)
        words = self._content[self._at :].split(None, count)
        if len(words) < count:
            raise ValueError("ends too early")
        rest = len(words[count]) if len(words) > count else 0
        self._at = len(self._content) - rest
        try:
            return np.array(words[:count], np.float64)
        except ValueError as error:
            raise ValueError(
                f"holds something else where {count} numbers should be ({error!s:.80})"
            ) from error
