"""Filter for requests of the page itself: other pages in the same browser reach neither its socket nor its files."""

from collections.abc import Mapping

from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_POLICY_VIOLATION = 1008
"""Code of a closing WebSocket for a policy violation (RFC 6455, 7.4.1)."""

_OWN_SITES = (b"", b"same-origin", b"none")
"""Accepted values of Sec-Fetch-Site: no browser, the page itself, the person (an address typed in)."""

HEADERS = {
    b"content-security-policy": b"frame-ancestors 'none'",
    b"cross-origin-resource-policy": b"same-origin",
    b"referrer-policy": b"no-referrer",
    b"x-content-type-options": b"nosniff",
}
"""Headers of every answer that does not set them itself."""


class OwnOrigin:
    """Middleware that refuses requests and sockets of other pages, and keeps other pages from framing this one."""

    def __init__(self, inner: ASGIApp) -> None:
        """Wrap an application."""
        self.inner = inner

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer with 403, or let the application answer and add the headers."""
        if scope["type"] not in ("http", "websocket"):
            await self.inner(scope, receive, send)
        elif is_foreign(dict(scope["headers"])):
            await _refuse(scope, receive, send)
        else:
            await self.inner(scope, receive, _with_headers(send))


def is_foreign(headers: Mapping[bytes, bytes]) -> bool:
    """Check whether another page makes a request, by its origin, else by the Sec-Fetch headers of the browser.

    A link on another page may open this page in a new window, because the other page cannot read that window.
    """
    if b"origin" in headers:
        return headers[b"origin"] != b"http://" + headers.get(b"host", b"")
    opens_window = (headers.get(b"sec-fetch-mode"), headers.get(b"sec-fetch-dest")) == (b"navigate", b"document")
    return headers.get(b"sec-fetch-site", b"") not in _OWN_SITES and not opens_window


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": _POLICY_VIOLATION})
    else:
        await PlainTextResponse("Only the page itself may ask for this", 403)(scope, receive, send)


def _with_headers(send: Send) -> Send:
    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            there = dict(message.get("headers", ()))
            message["headers"] = [*message.get("headers", ()), *(one for one in HEADERS.items() if one[0] not in there)]
        await send(message)

    return sending
