"""A report opened in a real browser: what is drawn, and what the browser had to say of it."""

import json
from dataclasses import dataclass, field
from typing import Any

import pytest
from playwright.sync_api import Page

from scripts.picture_report import BROWSERS, installed_browser

needs_browser = pytest.mark.skipif(installed_browser() is None, reason=f"none of {', '.join(BROWSERS)} is installed")

DESK = {"width": 1280, "height": 900}
PHONE = {"width": 390, "height": 844}

SETTLED_MS = 500
"""The longest pause between two frames of a turning view that was seen on a machine with every core taken."""

SETTLING_READS = 40

EYE = "document.getElementById('view')._fullLayout.scene._scene.getCamera().eye"


@dataclass
class Seen:
    """A page, and what the browser had to say of it."""

    page: Page
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def traces(self, place: str = "view") -> list[dict[str, Any]]:
        """What is drawn there."""
        return json.loads(self.page.evaluate(f"JSON.stringify(document.getElementById('{place}').data)"))

    def data(self) -> dict[str, Any]:
        return json.loads(self.page.inner_text("#data") or self.page.text_content("#data") or "")

    def eye(self) -> dict[str, float]:
        """Where the 3-D view is seen from."""
        return self.page.evaluate(EYE)

    def settled_eye(self) -> dict[str, float]:
        """The same once the view has come to rest: on a busy machine it still turns long after the mouse is let go."""
        now = self.eye()
        for _ in range(SETTLING_READS):
            self.page.wait_for_timeout(SETTLED_MS)
            last, now = now, self.eye()
            if now == last:
                return now
        raise AssertionError(f"the view still turns after {SETTLING_READS * SETTLED_MS} ms")

    def assert_quiet(self) -> None:
        """No error, nothing asked of a network, nothing wider than the window."""
        assert self.errors == []
        assert [url for url in self.requests if not url.startswith(("file:", "blob:", "data:"))] == []
        width, window = self.page.evaluate("[document.documentElement.scrollWidth, window.innerWidth]")
        assert width <= window
