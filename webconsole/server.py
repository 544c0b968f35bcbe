"""The server of the page: files, scenes, series of a recording, and a WebSocket for each page."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncGenerator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from math import isfinite

import numpy as np
import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from hub.planning.scenario_file import installed_scenarios
from schemas.errors import TrocarError
from webconsole.afterlife import Afterlife
from webconsole.assets import asset, compress_all, gzip_response
from webconsole.commands import MOST_BYTES
from webconsole.console import Console
from webconsole.fork import fork_form, tree_of
from webconsole.gate import MOST_HEAD_BYTES, Gate, Role
from webconsole.library import Library, numbers_of
from webconsole.listening import Listening
from webconsole.page import Page
from webconsole.recorded import Recorded
from webconsole.start import start_form

__all__ = ["Server"]

_MOST_PAGES = 16
_MOST_VIEWERS = 12
"""Most pages of viewers: the rest are kept for operators."""
_NOT_SHOWN = 4002
"""Close code for a page whose recording cannot be shown; the reason says why."""
_MOST_REASON_BYTES = 123
"""Longest reason of a close frame (RFC 6455, 5.5)."""
_AHEAD_S = 0.2
_MOST_BUCKETS = 4000
_MOST_CONTACTS, _MOST_POINTS = 6, 300
"""Contacts of a bond on a page, and points of each."""
_BINARY = "application/octet-stream"
_FOR_EVER = "private, max-age=31536000, immutable"
"""Cache-Control of content named by its hash."""


class _WebSocket(WebSocketsSansIOProtocol):
    """WebSocket of uvicorn; `shutdown` (0.54) fails, and so the server's, while a page is closing itself."""

    def shutdown(self) -> None:
        if not self.transport.is_closing():
            super().shutdown()


class Server:
    """Serves the pages of a console.

    Args:
        console: Contents of the pages.
        listening: Where.
        others: Servers of programs, by the path of a WebSocket.
        afterlife: What follows the end of the only session; None: pages wait for another session.
        library: Further recordings for the pages of operators; None: none.
    """

    def __init__(
        self,
        console: Console,
        listening: Listening,
        others: Mapping[str, Callable[[WebSocket], Awaitable[None]]] | None = None,
        afterlife: Afterlife | None = None,
        library: Library | None = None,
    ) -> None:
        self._console, self._socket, self._afterlife = console, listening.socket, afterlife
        self._library = library
        self.port = listening.port
        self._pages: Counter[Role] = Counter()
        app = Starlette(
            lifespan=self._ahead,
            routes=[
                Route("/", asset),
                Route("/web/{name:path}", asset),
                Route("/scene", self._scene),
                Route("/appearance", self._appearance),
                Route("/texture/{name}", self._texture),
                Route("/series", self._series),
                Route("/contacts", self._contacts),
                Route("/events", self._events),
                Route("/numbers", self._numbers),
                Route("/recordings", self._recordings),
                Route("/sessions", self._sessions),
                Route("/start", self._start),
                Route("/fork", self._fork),
                Route("/forks", self._answer_forks),
                WebSocketRoute("/page", self._page),
                *(WebSocketRoute(path, serve) for path, serve in (others or {}).items()),
            ],
        )
        self.gate = Gate(app, listening.origins)
        self._uvicorn = uvicorn.Server(
            uvicorn.Config(
                self.gate,
                log_level="warning",
                access_log=False,
                lifespan="on",
                http="h11",  # httptools, where it is installed, has no limit of a head
                h11_max_incomplete_event_size=MOST_HEAD_BYTES,
                ws=_WebSocket,
                ws_max_size=MOST_BYTES,
                ws_per_message_deflate=False,
                ws_ping_interval=5.0,
                ws_ping_timeout=20.0,
                timeout_graceful_shutdown=1,
                server_header=False,
                ssl_certfile=listening.certificate,
            )
        )

    def run(self, started: Callable[[], None] = lambda: None) -> None:
        """Serve until Ctrl-C or SIGTERM; `started` is called before the first request."""
        started()
        try:
            self._uvicorn.run(sockets=[self._socket])
        finally:
            self._console.started.close()
            self._console.source.close()
            self._socket.close()

    def stop(self) -> None:
        """Let `run` return soon; from any thread."""
        self._uvicorn.should_exit = True

    @asynccontextmanager
    async def _ahead(self, _app: Starlette) -> AsyncGenerator[None]:
        """Make the stage of each session before the first page asks."""

        async def make() -> None:
            await asyncio.to_thread(compress_all)
            while True:
                await self._console.stage()
                await asyncio.sleep(_AHEAD_S)

        tasks = [asyncio.create_task(make())]
        if self._afterlife is not None:
            tasks.append(asyncio.create_task(self._afterlife.run(self._pages.total, self.stop)))
        try:
            yield
        finally:
            for task in tasks:
                task.cancel()

    async def _page(self, websocket: WebSocket) -> None:
        role: Role = websocket.state.role
        if self._pages.total() >= _MOST_PAGES or (role == "viewer" and self._pages[role] >= _MOST_VIEWERS):
            await websocket.close(1013, f"{self._pages.total()} pages are open already")
            return
        self._pages[role] += 1
        try:
            console = await self._console_for(websocket)
        except (HTTPException, TrocarError) as error:
            self._pages[role] -= 1
            await websocket.accept()
            await websocket.close(_NOT_SHOWN, _close_reason(error))
            return
        try:
            await Page(websocket, role, console, self.gate).run()
        finally:
            self._pages[role] -= 1

    async def _console_for(self, request: HTTPConnection) -> Console:
        """Return the contents of the page that asks: the server's own, or those of another recording.

        Raises HTTPException for a viewer, MessageError for an unknown name, RecordingError if the recording
        cannot be read.
        """
        name = request.query_params.get("recording")
        if name is None or self._library is None:
            return self._console
        if request.state.role != "operator":
            raise HTTPException(403, "a viewer opens no other recording\n")
        return await self._library.console(name)

    async def _recordings(self, request: Request) -> Response:
        """Answer an operator with the recordings that may be opened."""
        if request.state.role != "operator":
            return PlainTextResponse("a viewer opens no other recording\n", status_code=403)
        return JSONResponse([] if self._library is None else await asyncio.to_thread(self._library.rows))

    async def _numbers(self, request: Request) -> Response:
        """Answer with the result of a recorded session."""
        return await self._from_recorded(request, numbers_of)

    async def _scene(self, request: Request) -> Response:
        try:
            stage = await (await self._console_for(request)).stage()
        except TrocarError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)
        if stage is None:
            return PlainTextResponse("no session\n", status_code=404)
        return gzip_response(stage.packed_geometry, _BINARY)

    async def _appearance(self, request: Request) -> Response:
        """Answer with the appearance of the scene; 204: the session has none."""
        try:
            found = await (await self._console_for(request)).appearance()
        except TrocarError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)
        return Response(status_code=204) if found is None else gzip_response(found.packed, _BINARY)

    async def _texture(self, request: Request) -> Response:
        """Answer with a texture by its hash: a browser asks once, whatever the session."""
        try:
            picture = (await self._console_for(request)).texture(request.path_params["name"])
        except TrocarError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)
        if picture is None:
            return PlainTextResponse("no such texture\n", status_code=404)
        return Response(picture, media_type="image/jpeg", headers={"Cache-Control": _FOR_EVER})

    async def _series(self, request: Request) -> Response:
        """Answer with the rows of a numeric port of a recording, f64; their columns are in a header."""
        query = request.query_params
        try:
            start, end = float(query.get("from", "0")), float(query.get("to", "inf"))
            buckets = min(int(query.get("buckets", "1000")), _MOST_BUCKETS)
            if buckets < 1 or not isfinite(start):
                raise ValueError(f"from {start}, {buckets} buckets")
            recorded = (await self._console_for(request)).recorded_source()
            columns, rows = await asyncio.to_thread(
                recorded.series, query.get("port", ""), start, end, buckets
            )
        except (TrocarError, ValueError) as error:
            return PlainTextResponse(f"{error}\n", status_code=400)
        return Response(
            rows.astype("<f8").tobytes(), media_type=_BINARY, headers={"X-Width": str(len(columns) + 1)}
        )

    async def _contacts(self, request: Request) -> Response:
        """Answer with the newest contacts of a bond: rows of number, depth (mm) and force (N), f32."""
        try:
            console = await self._console_for(request)
            contacts = await console.contacts(request.query_params.get("bond", ""))
        except TrocarError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)
        lines = [one.thin(_MOST_POINTS) for one in contacts[-_MOST_CONTACTS:]]
        rows = [
            np.column_stack([np.full(len(one.force), i), 1e3 * one.depth, one.force])
            for i, one in enumerate(lines)
        ]
        return Response(np.vstack([np.empty((0, 3)), *rows]).astype("<f4").tobytes(), media_type=_BINARY)

    async def _events(self, request: Request) -> Response:
        """Answer with the events of a recording."""
        return await self._from_recorded(request, lambda one: [event.as_json() for event in one.events])

    async def _sessions(self, _request: Request) -> Response:
        """Answer with the running sessions of this machine."""
        try:
            live = self._console.live_source()
            return JSONResponse(await asyncio.to_thread(live.sessions))
        except TrocarError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)

    async def _start(self, request: Request) -> Response:
        """Answer an operator with the installed scenarios, or with the form of a scenario."""
        if request.state.role != "operator":
            return PlainTextResponse("a viewer starts no session\n", status_code=403)
        name = request.query_params.get("scenario")
        try:
            if name is None:
                return JSONResponse([*installed_scenarios()])
            return JSONResponse(await asyncio.to_thread(start_form, name))
        except TrocarError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)

    async def _fork(self, request: Request) -> Response:
        """Answer with the form of a fork."""
        return await self._from_recorded(request, lambda one: fork_form(one.recording))

    async def _answer_forks(self, request: Request) -> Response:
        """Answer with the tree of the recordings beside this recording."""
        return await self._from_recorded(request, lambda one: tree_of(one.recording))

    async def _from_recorded(self, request: Request, make: Callable[[Recorded], object]) -> Response:
        try:
            recorded = (await self._console_for(request)).recorded_source()
            return JSONResponse(await asyncio.to_thread(make, recorded))
        except TrocarError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)


def _close_reason(error: Exception) -> str:
    """Return why a page is closed, in the bytes allowed."""
    text = error.detail if isinstance(error, HTTPException) else str(error)
    return text.strip().encode()[:_MOST_REASON_BYTES].decode("utf-8", "ignore")
