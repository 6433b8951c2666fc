"""Web server of the page: this machine only, limited size of requests, a temporary folder removed at the end."""

import shutil
import socket
import tempfile
from pathlib import Path

from fastapi import HTTPException
from fastapi.responses import FileResponse
from nicegui import app, ui
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from adapt.cli.local_page.own_origin import OwnOrigin
from adapt.cli.local_page.session import ZIP, Session
from adapt.cli.local_page.session_page import SessionPage, add_style
from adapt.cli.local_page.uploads import LARGEST_FILE_BYTES
from motions import InputError

LOOPBACK = "127.0.0.1"

RECONNECT_S = 600.0
"""Time in s to keep the files of a page after the last contact with its browser: a laptop may sleep a while."""

PATIENCE_S = 2
"""Time in s that open connections may take to end after Ctrl-C."""

LARGEST_BODY_BYTES = LARGEST_FILE_BYTES + 1_000_000
"""Largest size of a request: a file and its form fields."""

SANDBOX = "sandbox allow-scripts allow-downloads allow-popups allow-modals; frame-ancestors 'self'"
"""Content security policy of a report: its scripts may run, but reach neither the page nor its session. Only the page
may show the report in a frame."""

CONNECTS_WITHIN_S = 30.0
"""Time in s for a browser that has got the page to open a socket; a request that opens none gets no session."""


class LimitedBody:
    """Middleware that refuses a request of too large or undeclared size before its body is read."""

    def __init__(self, inner: ASGIApp) -> None:
        """Wrap an application."""
        self.inner = inner

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer with 411 or 413, or let the application answer."""
        if scope["type"] == "http" and scope["method"] not in ("GET", "HEAD", "OPTIONS"):
            length = dict(scope["headers"]).get(b"content-length", b"")
            status = 411 if not length.isdigit() else 413 if int(length) > LARGEST_BODY_BYTES else 0
            if status:
                await PlainTextResponse("The file is too large", status)(scope, receive, send)
                return
        await self.inner(scope, receive, send)


def free_port(port: int = 0) -> int:
    """Return the port if it is free, or any free port for 0; raise an InputError if the port is taken."""
    with socket.socket() as one:
        one.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            one.bind((LOOPBACK, port))
        except OSError as error:
            raise InputError(
                "--port", None, f"port {port} cannot be used ({error.strerror})", "Choose another"
            ) from error
        return one.getsockname()[1]


def serve(port: int, browser: bool = True, reconnect_s: float = RECONNECT_S) -> None:
    """Serve the page on the loopback address until Ctrl-C.

    ``browser``: True to open the page. ``reconnect_s``: time for which the files of a closed page are kept.
    """
    sessions: dict[str, Session] = {}
    with tempfile.TemporaryDirectory(prefix="girdle-app-", ignore_cleanup_errors=True) as folder:
        tempfile.tempdir = folder  # the framework keeps large uploads in temporary files
        _add_routes(sessions)

        async def page() -> None:
            client = ui.context.client
            add_style()
            await client.connected(CONNECTS_WITHIN_S)
            if client.is_deleted:
                return
            session = Session(Path(folder))
            sessions[session.token] = session
            client.on_delete(lambda: sessions.pop(session.token).close())
            SessionPage(session).build()

        def close_all() -> None:
            """Clean up before the server ends, because a terminating signal is raised again afterwards."""
            for session in sessions.values():
                session.close()
            shutil.rmtree(folder, ignore_errors=True)

        app.on_shutdown(close_all)
        app.add_middleware(LimitedBody)
        app.add_middleware(OwnOrigin)
        app.add_middleware(TrustedHostMiddleware, allowed_hosts=[LOOPBACK, "localhost"])  # no other host name is served
        ui.run(
            page,
            host=LOOPBACK,
            port=port,
            title="girdle",
            favicon=_ICON,
            language="en-US",
            show=browser,
            reload=False,
            show_welcome_message=False,
            reconnect_timeout=reconnect_s,
            timeout_graceful_shutdown=PATIENCE_S,
        )
    tempfile.tempdir = None


def _add_routes(sessions: dict[str, Session]) -> None:
    """Serve the reports and the zip of a session to clients that know its token, and no other file."""

    @app.get("/session/{token}/{what}")
    def given(token: str, what: str) -> FileResponse:
        session = sessions.get(token)
        if session is None:
            raise HTTPException(404)
        if what == ZIP:
            return FileResponse(session.zipped(), filename=ZIP)
        path = session.report(what)
        if path is None:
            raise HTTPException(404)
        return FileResponse(path, media_type="text/html", headers={"Content-Security-Policy": SANDBOX})


_ICON = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 16 16"><path d="M2 3 L13 5 L10 14 Z" fill="none" '
    'stroke="#0072b2" stroke-width="2" stroke-linejoin="round"/></svg>'
)
"""Icon of the page: a scapula."""
