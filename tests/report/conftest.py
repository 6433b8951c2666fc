"""Pages opened in a real browser, for the tests of the report."""

from collections.abc import Iterator
from typing import Any

import pytest
from browsing import DESK, Seen
from playwright.sync_api import BrowserContext, Page

from scripts.picture_report import browser, open_report


@pytest.fixture(scope="module")
def started() -> Iterator[BrowserContext]:
    """One profile for all pages: a window for each would cost half a second of a core more."""
    with browser() as one:
        yield one.new_context()


@pytest.fixture
def look(started, tmp_path) -> Iterator[Any]:
    """Open a report's text in a window of its own."""
    pages: list[Page] = []

    def opened(html: str, window: dict[str, int] = DESK) -> Seen:
        path = tmp_path / f"report{len(pages)}.html"
        path.write_text(html, encoding="utf-8")
        page = started.new_page()
        page.set_viewport_size(window)
        pages.append(page)
        seen = Seen(page)
        page.on("console", lambda said: seen.errors.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: seen.errors.append(str(error)))
        page.on("dialog", lambda dialog: (seen.errors.append(f"dialog {dialog.message}"), dialog.dismiss()))
        page.on("request", lambda request: seen.requests.append(request.url))
        open_report(page, path)
        return seen

    yield opened
    for page in pages:
        page.close()
