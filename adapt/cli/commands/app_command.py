"""Options and help of ``girdle app``, the local page."""

import importlib.util
from typing import Annotated

import typer

from adapt.cli.options import console
from motions.errors import InputError, pip_install


def open_app(
    port: Annotated[int, typer.Option(min=0, max=65535, help="Where the page is; 0: any that is free.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> None:
    """Open a local page: drop files, see what was read, adapt and diagnose, download everything as a zip.

    Only this machine can reach the page (127.0.0.1). Its files are in a temporary folder, which is removed with the
    page. Needs the extra `app` of the package. Ctrl-C ends the page.
    """
    if importlib.util.find_spec("nicegui") is None:
        cause = "the page needs nicegui, which is not installed"
        raise InputError("girdle app", None, cause, f"Install it: {pip_install('nicegui')}")
    from adapt.cli.local_page.server import LOOPBACK, free_port, serve  # slow import: a web server

    chosen = free_port(port)
    console.print(f"girdle app at http://{LOOPBACK}:{chosen} (Ctrl-C ends it)", soft_wrap=True)
    serve(chosen, browser)
