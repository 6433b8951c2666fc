"""Pages in a real browser, for the tests of the report."""

from collections.abc import Callable, Iterator

import pytest
from browsing import COARSE, WIDE, Seen
from playwright.sync_api import BrowserContext

from scripts.picture_report import browser, open_report


@pytest.fixture(scope="module")
def started() -> Iterator[BrowserContext]:
    """Start one browser profile for all pages: a window for each would cost half a second of a core more."""
    with browser() as one:
        yield one.new_context()


@pytest.fixture(scope="module")
def look(started, tmp_path_factory) -> Callable[..., Seen]:
    """Return a function that shows a report's text in a window; the same report is reset instead of loaded again.

    Loading a report takes seconds of a core, most of them in the drawing library.
    """
    folder = tmp_path_factory.mktemp("reports")
    shown: dict[str, Seen] = {}

    def opened(html: str, window: dict[str, int] = WIDE) -> Seen:
        if html not in shown:
            for other in shown.values():
                other.page.close()
            shown.clear()
            path = folder / "report.html"
            path.write_text(html, encoding="utf-8")
            page = started.new_page()
            page.add_init_script(COARSE)
            page.set_viewport_size(window)
            seen = Seen(page)
            page.on("console", lambda said: seen.errors.append(said.text) if said.type == "error" else None)
            page.on("pageerror", lambda error: seen.errors.append(str(error)))
            page.on("dialog", lambda dialog: (seen.errors.append(f"dialog {dialog.message}"), dialog.dismiss()))
            page.on("request", lambda request: seen.requests.append(request.url))
            open_report(page, path)
            shown[html] = seen
            seen.remember()
        else:
            shown[html].start_anew(window)
        return shown[html]

    return opened
