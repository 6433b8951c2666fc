"""A report in a real browser: the charts that it draws, and the errors and requests that the browser reports."""

import json
from dataclasses import dataclass, field
from typing import Any

import pytest
from playwright.sync_api import Page

from scripts.picture_report import BROWSERS, installed_browser

needs_browser = pytest.mark.skipif(installed_browser() is None, reason=f"none of {', '.join(BROWSERS)} is installed")

WIDE = {"width": 1400, "height": 900}
DESK = {"width": 1280, "height": 900}
PHONE = {"width": 390, "height": 844}
TABLET = {"width": 800, "height": 900}

COARSE = """
let plotly;
Object.defineProperty(window, "Plotly", {
  get: () => plotly,
  set: (given) => (plotly = given).setPlotConfig({ plotGlPixelRatio: 0.5 }),
});
"""
"""Script that runs before those of a page: it draws the 3-D view with half a pixel per CSS pixel instead of Plotly's
two. Without a graphics card these pixels are a fifth of the work of a page; positions and data of the drawing stay the
same."""

SETTLED_FRAMES = 4
"""Number of equal frames after which the view counts as at rest: it follows the mouse with a delay of a few ms."""

EYE = "document.getElementById('view')._fullLayout.scene._scene.getCamera().eye"

SETTLED = f"""
(frames) => new Promise((done) => {{
  let last = "", alike = 0;
  const look = () => {{
    const now = JSON.stringify({EYE});
    alike = now === last ? alike + 1 : 0;
    last = now;
    if (alike < frames) requestAnimationFrame(look);
    else done(JSON.parse(now));
  }};
  look();
}})
"""

START = """
(chosen) => {
  if (typeof playing !== "undefined" && playing !== null) play(); // a test that failed has left it on
  document.querySelectorAll("details[open]").forEach((one) => (one.open = false));
  ["model", "lines", "joint"].filter(element).forEach((key) => (element(key).value = chosen[key]));
  go({ ...chosen, looks: at.looks + 1 });
}
"""

LOOKS_AS_ASKED = f"""
() => {{
  const eye = {EYE}, asked = VIEWS[at.view];
  return ["x", "y", "z"].every((axis) => Math.abs(eye[axis] - asked[axis]) < 0.01);
}}
"""

STARTS = 5
"""Number of attempts to set the view, which may turn on from the previous test after it was set."""


@dataclass
class Seen:
    """A page, with its errors and requests."""

    page: Page
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    chosen: dict[str, Any] = field(default_factory=dict)

    def traces(self, place: str = "view") -> list[dict[str, Any]]:
        """Read the traces of a chart."""
        return json.loads(self.page.evaluate(f"JSON.stringify(document.getElementById('{place}').data)"))

    def data(self) -> dict[str, Any]:
        return json.loads(self.page.inner_text("#data") or self.page.text_content("#data") or "")

    def settled_eye(self) -> dict[str, float]:
        """Wait until the 3-D view is at rest, and return its camera position."""
        return self.page.evaluate(SETTLED, SETTLED_FRAMES)

    def remember(self) -> None:
        """Store the choices with which the page opens."""
        self.chosen = self.page.evaluate("({...at})")

    def start_anew(self, window: dict[str, int]) -> None:
        """Restore the page as opened in a window of this size, with all charts drawn again."""
        if self.page.viewport_size != window:
            self.page.set_viewport_size(window)  # type: ignore[arg-type]
            self.page.evaluate("Promise.all([...document.querySelectorAll('.figure')].map(Plotly.Plots.resize))")
        self.page.mouse.up()
        for _ in range(STARTS):
            self.page.evaluate(START, self.chosen)
            self.settled_eye()
            if self.page.evaluate(LOOKS_AS_ASKED):
                break
        else:
            pytest.fail(f"the view is not the one asked for, {STARTS} times")
        self.errors.clear()
        self.requests.clear()

    def assert_quiet(self) -> None:
        """Check that the page has no error, asks for nothing from a network, and is no wider than the window."""
        assert self.errors == []
        assert [url for url in self.requests if not url.startswith(("file:", "blob:", "data:"))] == []
        width, window = self.page.evaluate("[document.documentElement.scrollWidth, window.innerWidth]")
        assert width <= window


def numbers_of(seen: Seen, chart: str) -> list[list[str]]:
    """Return the table beside a chart: its headings, then its rows."""
    numbers = seen.page.locator(f".numbers[data-of={chart}]:visible")
    if numbers.get_attribute("open") is None:
        numbers.locator("summary").click()
        numbers.locator("td").first.wait_for()
    rows = "one => [...one.querySelectorAll('tr')].map(row => [...row.cells].map(cell => cell.textContent))"
    return numbers.evaluate(rows)


def column(table: list[list[str]], heading: str) -> list[float | None]:
    """Return one column of a table of ``numbers_of``, with None for an empty cell."""
    headings, *rows = table
    at = headings.index(heading)
    return [float(row[at]) if row[at] else None for row in rows]
