"""The files of the page, compressed once and kept."""

from __future__ import annotations

import gzip
from functools import cache
from importlib.resources import files

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

__all__ = ["asset", "compress_all", "gzip_response"]

_TYPES = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}


async def asset(request: Request) -> Response:
    """Return a file of the page."""
    name = request.path_params.get("name", "index.html")
    if name not in _names():
        return PlainTextResponse("no such file\n", status_code=404)
    return gzip_response(_content(name), _TYPES[name.rpartition(".")[2]], cache=name.startswith("vendor/"))


def gzip_response(content: bytes, kind: str, *, cache: bool = False) -> Response:
    """Return a response of gzip-compressed content; `cache`: for a day, as the content never changes."""
    headers = {"Content-Encoding": "gzip"}
    if cache:
        headers["Cache-Control"] = "private, max-age=86400"
    return Response(content, media_type=kind, headers=headers)


def compress_all() -> None:
    """Compress all files of the page before the first request."""
    for name in _names():
        _content(name)


@cache
def _names() -> frozenset[str]:
    """Return the names of all files of the page: nothing else of the disk can be asked for."""
    root = files("webconsole") / "web"
    own = {entry.name for entry in root.iterdir() if entry.is_file()}
    vendored = {f"vendor/{entry.name}" for entry in (root / "vendor").iterdir()}
    return frozenset(name for name in own | vendored if name.rpartition(".")[2] in _TYPES)


@cache
def _content(name: str) -> bytes:
    return gzip.compress((files("webconsole") / "web" / name).read_bytes(), 6, mtime=0)
