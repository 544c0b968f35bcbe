"""The server of the page: files, scenes, series of a recording, and a WebSocket for each page."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncGenerator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from math import isfinite

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from hub.planning.scenario_file import installed_scenarios
from hub.recording.recording import Recording
from schemas.errors import MessageError, TrocarError
from webconsole.afterlife import Afterlife
from webconsole.assets import asset, compress_all, gzip_response
from webconsole.commands import MOST_BYTES
from webconsole.console import Console
from webconsole.fork import fork_form, tree_of
from webconsole.gate import MOST_HEAD_BYTES, Gate, Role
from webconsole.listening import Listening
from webconsole.page import Page
from webconsole.start import start_form

__all__ = ["Server"]

_MOST_PAGES = 16
_MOST_VIEWERS = 12
"""Most pages of viewers: the rest are kept for operators."""
_AHEAD_S = 0.2
_MOST_BUCKETS = 4000
_BINARY = "application/octet-stream"


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
    """

    def __init__(
        self,
        console: Console,
        listening: Listening,
        others: Mapping[str, Callable[[WebSocket], Awaitable[None]]] | None = None,
        afterlife: Afterlife | None = None,
    ) -> None:
        self._console, self._socket, self._afterlife = console, listening.socket, afterlife
        self.port = listening.port
        self._pages: Counter[Role] = Counter()
        app = Starlette(
            lifespan=self._ahead,
            routes=[
                Route("/", asset),
                Route("/web/{name:path}", asset),
                Route("/scene", self._scene),
                Route("/series", self._series),
                Route("/pressed", self._force_rows),
                Route("/events", self._events),
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
            await Page(websocket, role, self._console, self.gate).run()
        finally:
            self._pages[role] -= 1

    async def _scene(self, _request: Request) -> Response:
        stage = await self._console.stage()
        if stage is None:
            return PlainTextResponse("no session\n", status_code=404)
        return gzip_response(stage.packed_geometry, _BINARY)

    async def _series(self, request: Request) -> Response:
        """Answer with the rows of a numeric port of a recording, f64; their columns are in a header."""
        query = request.query_params
        try:
            start, end = float(query.get("from", "0")), float(query.get("to", "inf"))
            buckets = min(int(query.get("buckets", "1000")), _MOST_BUCKETS)
            if buckets < 1 or not isfinite(start):
                raise ValueError(f"from {start}, {buckets} buckets")
            recorded = self._console.recorded_source()
            columns, rows = await asyncio.to_thread(
                recorded.series, query.get("port", ""), start, end, buckets
            )
        except (TrocarError, ValueError) as error:
            return PlainTextResponse(f"{error}\n", status_code=400)
        return Response(
            rows.astype("<f8").tobytes(), media_type=_BINARY, headers={"X-Width": str(len(columns) + 1)}
        )

    async def _force_rows(self, request: Request) -> Response:
        """Answer with time, point and force of a bond of a recording, rows of seven f64."""
        try:
            recorded, stage = self._console.recorded_source(), await self._console.stage()
            name = request.query_params.get("bond")
            found = [one for one in (stage.arrows if stage else ()) if one.name == name and one.at_one_point]
            if not found:
                raise MessageError("no bond of this name acts at one point")
            rows = await asyncio.to_thread(recorded.force_rows, found[0], _MOST_BUCKETS)
        except TrocarError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)
        return Response(rows.astype("<f8").tobytes(), media_type=_BINARY)

    async def _events(self, _request: Request) -> Response:
        """Answer with the events of a recording."""
        try:
            recorded = self._console.recorded_source()
            found = await asyncio.to_thread(lambda: recorded.events)
        except TrocarError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)
        return JSONResponse([one.as_json() for one in found])

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

    async def _fork(self, _request: Request) -> Response:
        """Answer with the form of a fork."""
        return await self._of_recording(fork_form)

    async def _answer_forks(self, _request: Request) -> Response:
        """Answer with the tree of the recordings beside this recording."""
        return await self._of_recording(tree_of)

    async def _of_recording(self, make: Callable[[Recording], object]) -> Response:
        try:
            return JSONResponse(await asyncio.to_thread(make, self._console.recorded_source().recording))
        except TrocarError as error:
            return PlainTextResponse(f"{error}\n", status_code=400)
