"""Access to the page: for the holder of a one-time link, by a cookie from then on.

Any website open in the same browser can send requests to this machine, and any name can be made to point to
this machine. So the Host must be this server's own name, the Origin this server's page, and the cookie from
this server. The same holds for further machines, connected by TLS alone.
"""

from __future__ import annotations

import logging
import secrets
from collections.abc import Mapping, Sequence
from time import monotonic_ns
from typing import Literal
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from hub.participant.token_bucket import TokenBucket

__all__ = ["Gate", "Role"]

log = logging.getLogger(__name__)

Role = Literal["viewer", "operator"]

MOST_HEAD_BYTES = 4096
"""Size of a request's target and headers together; a browser's own take about 1 KB."""
_TOKEN_BYTES = 32
_LOGGED_PER_S = 5.0
_MOST_BROWSERS = 64
"""Most browsers admitted for each role, so that no viewer takes an operator's place."""
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:;"
        " connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}


class Gate:
    """Passes requests to `app` from this server's own page in an admitted browser.

    A passed request has `role` in the scope's state.

    Args:
        app: The page.
        origins: Origins of the page, such as `http://127.0.0.1:8470`; all with the same scheme.
    """

    def __init__(self, app: ASGIApp, origins: Sequence[str]) -> None:
        self._app, self._origins = app, frozenset(origins)
        self._hosts = {origin.partition("//")[2] for origin in origins}
        self._secure = origins[0].startswith("https:")
        # cookies do not know ports; one with __Host- is of this very host, by TLS (RFC 6265bis, 4.1.3.2)
        self._cookie = f"{'__Host-' if self._secure else ''}trocar_{urlsplit(origins[0]).port or ''}"
        self._invited: dict[str, Role] = {}
        self._in: dict[str, Role] = {}
        self._links: dict[str, str] = {}
        """Token for access without a cookie, by the path of a WebSocket."""
        self._log = TokenBucket(_LOGGED_PER_S)

    def invite(self, role: Role) -> str:
        """Return the path, with a token, of a page for a single browser to open once."""
        token = secrets.token_urlsafe(_TOKEN_BYTES)
        self._invited[token] = role
        return f"/?token={token}"

    def link(self, path: str) -> str:
        """Return a path, with a token, of a read-only WebSocket for programs without cookies.

        The token is the whole of the secret, so such a link works again and again, and whatever the origin.
        """
        token = self._links.setdefault(path, secrets.token_urlsafe(_TOKEN_BYTES))
        return f"{path}?token={token}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check a request, then pass or refuse."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        if (size := _head_bytes(scope)) > MOST_HEAD_BYTES:
            why = (
                f"the request's head has {size} bytes, at most {MOST_HEAD_BYTES} are allowed: delete the"
                " cookies that other servers of this host have set"
            )
            await self._refuse(why, scope, receive, send, status=431)
            return
        headers = Headers(scope=scope)
        token = parse_qs(scope["query_string"].decode("ascii", "replace")).get("token", [""])[0]
        if scope["type"] == "websocket" and scope["path"] in self._links:
            await self._admit_by_link(token, headers, scope, receive, send)
            return
        problem = self._foreign_request(scope, headers)
        role = self._role(headers)
        if not problem and token and scope["type"] == "http" and scope["method"] == "GET":
            await self._admit_browser(token, role, scope, receive, send)
            return
        if problem or role is None:
            why = problem or "not let in: open the link that the server has printed"
            await self._refuse(why, scope, receive, send)
            return
        scope.setdefault("state", {})["role"] = role

        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                given = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    given.setdefault(name, value)
            await send(message)

        await self._app(scope, receive, with_headers if scope["type"] == "http" else send)

    async def _admit_by_link(
        self, token: str, headers: Mapping[str, str], scope: Scope, receive: Receive, send: Send
    ) -> None:
        """Let a program in by a link."""
        known = secrets.compare_digest(self._links[scope["path"]].encode(), token.encode())
        why = self._not_this_host(headers) or ("" if known else "this link is not this server's")
        if why:
            await self._refuse(why, scope, receive, send)
            return
        scope.setdefault("state", {})["role"] = "viewer"
        await self._app(scope, receive, send)

    def _not_this_host(self, headers: Mapping[str, str]) -> str:
        host = headers.get("host", "")
        return "" if host in self._hosts else f"host {host[:80]!r} is not this server's"

    def _foreign_request(self, scope: Scope, headers: Mapping[str, str]) -> str:
        """Return why a request does not come from this server's page; else empty."""
        if elsewhere := self._not_this_host(headers):
            return elsewhere
        origin = headers.get("origin")
        if origin is None and scope["type"] == "websocket":
            return "no origin: this is for the page alone"
        if origin is not None and origin not in self._origins:
            return f"origin {origin[:80]!r} is another website"
        if scope["type"] == "http" and scope["method"] not in ("GET", "HEAD"):
            return f"method {scope['method']:.10} is not used here"
        return ""

    def _role(self, headers: Mapping[str, str]) -> Role | None:
        """Return the role of a browser by cookie; None without a valid cookie of this server."""
        # not by http.cookies: it takes a time that grows with the square of a quoted value's length
        for pair in headers.get("cookie", "").split(";"):
            name, _, value = pair.strip().partition("=")
            if name == self._cookie:
                return _find_role(self._in, value)
        return None

    async def _admit_browser(
        self, token: str, known: Role | None, scope: Scope, receive: Receive, send: Send
    ) -> None:
        """Admit a browser by its token; an admitted browser only gets the page."""
        role = _find_role(self._invited, token)
        if role is None and known is not None:
            await RedirectResponse("/", status_code=303, headers=_HEADERS)(scope, receive, send)
            return
        if role is None:
            await self._refuse("this link was used, or is not this server's", scope, receive, send)
            return
        if [*self._in.values()].count(role) >= _MOST_BROWSERS:
            why = f"{_MOST_BROWSERS} browsers are let in as {role}s, and no more: start the server again"
            await self._refuse(why, scope, receive, send)
            return
        self._invited = {other: kept for other, kept in self._invited.items() if other != token}
        cookie = secrets.token_urlsafe(_TOKEN_BYTES)
        self._in[cookie] = role
        answer = RedirectResponse("/", status_code=303, headers=_HEADERS)
        answer.set_cookie(self._cookie, cookie, httponly=True, samesite="strict", secure=self._secure)
        await answer(scope, receive, send)

    async def _refuse(self, why: str, scope: Scope, receive: Receive, send: Send, status: int = 403) -> None:
        if self._log.spend(monotonic_ns()):
            client = scope.get("client") or ("?", 0)
            log.warning("refused %s %r from %s:%s: %s", scope["type"], scope["path"][:80], *client, why)
        if scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": why[:100]})
            return
        await PlainTextResponse(f"{why}\n", status_code=status, headers=_HEADERS)(scope, receive, send)


def _head_bytes(scope: Scope) -> int:
    """Return the size of a request's path, query and headers."""
    target = len(scope["path"]) + len(scope["query_string"])
    return target + sum(len(name) + len(value) for name, value in scope["headers"])


def _find_role(known: Mapping[str, Role], token: str) -> Role | None:
    """Return the role of a token, in a time independent of the token."""
    found: Role | None = None
    for one, role in known.items():
        if secrets.compare_digest(one.encode(), token.encode()):
            found = role
    return found
