"""Picture of a report as a user sees it: opened in the system's Chromium, stepped to a posture, saved as a PNG.

python scripts/picture_report.py out/adapt/report.html --out docs/report.png
"""

import io
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from PIL import Image
from playwright.sync_api import Browser, BrowserContext, Page, ViewportSize, sync_playwright

from adapt.cli import app as cli
from motions import InputError

BROWSERS = ("chromium", "chromium-browser", "google-chrome")

FLAGS = (
    *("--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--no-first-run", "--disable-quic", "--disable-background-networking"),
    *("--disable-component-update", "--disable-sync"),
)
"""Software WebGL, for a machine without a screen, and no background activity of the browser."""

DRAWN = "body[data-drawn=yes]"
PATIENCE_MS = 60_000.0
"""Timeout: 3-D drawn in software on a busy machine takes long."""

COLOURS = 256
"""Colours in the palette of the picture: a page has few, and the file is a third as large."""

app = typer.Typer(add_completion=False)


def installed_browser() -> str | None:
    """Return the path of the first browser that is installed."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


@contextmanager
def browser() -> Iterator[Browser]:
    """Start a headless browser with a fresh profile. InputError if none is installed."""
    path = installed_browser()
    if path is None:
        raise InputError("the browser", None, f"none of {', '.join(BROWSERS)} is installed", "Install Chromium")
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=path, headless=True, args=FLAGS)
        yield started
        started.close()


def open_report(page: Page, report: Path) -> None:
    """Open the file and wait until all of its figures are drawn."""
    page.goto(report.resolve().as_uri())
    page.wait_for_selector(DRAWN, timeout=PATIENCE_MS)


def picture(started: Browser | BrowserContext, report: Path, posture: int, window: ViewportSize) -> Image.Image:
    """Take a picture of the top of the page at one of its postures (numbered from 1), reduced to COLOURS."""
    page = started.new_page()
    page.set_viewport_size(window)
    open_report(page, report)
    page.fill("#posture", str(posture - 1))  # the page opens where the adaptation changes most
    page.evaluate("document.activeElement.blur()")
    shot = page.screenshot()
    page.close()
    return Image.open(io.BytesIO(shot)).convert("RGB").quantize(COLOURS)


@app.command()
def main(
    report: Annotated[Path, typer.Argument(metavar="report.html", help="A report that `girdle` wrote.")],
    out: Annotated[Path, typer.Option("--out", help="The PNG to write.")],
    posture: Annotated[int, typer.Option(min=1, help="The posture of the motion that is shown.")] = 5,
    width: Annotated[int, typer.Option(min=320, help="Of the window, pixels.")] = 1240,
    height: Annotated[int, typer.Option(min=320, help="Of the picture, pixels from the top of the page.")] = 1480,
) -> None:
    """Save the top of a report as a small PNG."""
    if not report.is_file():
        raise InputError(str(report), None, "there is no such file", "Name a report.html of `girdle adapt`")
    with browser() as started:
        picture(started, report, posture, {"width": width, "height": height}).save(out, optimize=True)


if __name__ == "__main__":
    cli.main(app)
