"""Checks of a report in a browser for readers without a mouse, with poor sight, or on paper."""

import io

import numpy as np
from axe_playwright_python.sync_playwright import Axe
from browsing import Seen
from PIL import Image
from playwright.sync_api import ViewportSize

A4_INSIDE: ViewportSize = {"width": 703, "height": 1016}
"""A4 less the margins of the page's style, 12 and 14 mm, in CSS pixels of 1/96 inch."""

FINGER_PX = 44
"""Target size of WCAG 2.1, success criterion 2.5.5."""

BESIDE = 10
"""Number of further stops of the Tab key that Chromium adds: the end of the page, parts that scroll."""

DARK = 64
"""Grey level (of 255) below which a pixel is dark: darker than every bar and map."""

_REACH = """
() => {
  window.hidden = new Set();
  const wanted = "a[href], button:enabled, select:enabled, input:enabled, summary, abbr, [tabindex='0']";
  window.unreached = new Set([...document.querySelectorAll(wanted)].filter((one) => one.checkVisibility()));
  document.addEventListener("focusin", ({ target }) => {
    unreached.delete(target);
    const { outlineStyle, outlineWidth } = getComputedStyle(target);
    const explained = getComputedStyle(target, "::after").content === JSON.stringify(target.title);
    const group = target.closest(".modebar-group");
    const seen = [
      outlineStyle !== "none" && parseFloat(outlineWidth) >= 1,
      explained || !target.matches("abbr"),
      !group || getComputedStyle(group).opacity === "1",
    ];
    hidden[seen.includes(false) ? "add" : "delete"](target);
  });
  return unreached.size;
}
"""

_ON_PAPER = """
() => {
  const all = (what) => [...document.querySelectorAll(what)].filter((one) => one.checkVisibility());
  const name = (one) => one.outerHTML.slice(0, 120);
  const fits = (one) => one.scrollWidth <= one.clientWidth + 1;
  const inside = (one) => one.getBoundingClientRect().right <= innerWidth + 0.5 && fits(one);
  const filled = (one) => Math.abs(one.querySelector(".main-svg").clientWidth - one.clientWidth) <= 1;
  return {
    cut: all("main, section, .scroll, .figure, .answer, img").filter((one) => !inside(one)).map(name),
    other_width: all(".figure").filter((one) => !filled(one)).map(name),
    controls: all("button:not(.person), select, input, nav, .screen").map(name),
    pictures: all("img").map((one) => one.naturalWidth > 0),
    budget_ends: document.querySelector("header + section").getBoundingClientRect().bottom + scrollY,
    headings_alone: all("h1, h2, h3").filter((one) => getComputedStyle(one).breakAfter !== "avoid").map(name),
  };
}
"""

_SMALL = f"""
() => [...document.querySelectorAll("button:not(.modebar-btn), select, input, summary, nav a")]
  .filter((one) => one.checkVisibility() && one.getBoundingClientRect().height < {FINGER_PX} - 0.5)
  .map((one) => one.outerHTML.slice(0, 120))
"""


def grave_faults(seen: Seen) -> list[str]:
    """List the faults that axe-core calls serious or critical: contrast, names, order, parts out of reach of the
    keyboard, small targets.

    Drawings of charts are left out: axe cannot tell the background of a text there.
    """
    options = {"resultTypes": ["violations"], "rules": {"target-size": {"enabled": True}}}
    found = Axe().run(seen.page, context={"exclude": [[".main-svg"]]}, options=options).response["violations"]
    grave = [one for one in found if one["impact"] in ("serious", "critical")]
    return [f"{one['id']}: {node['html']}" for one in grave for node in one["nodes"]]


def contrast(one: str, other: str) -> float:
    """Compute the contrast ratio of WCAG 2 of two colours written #rrggbb."""
    dark, light = sorted(map(_luminance, (one, other)))
    return (light + 0.05) / (dark + 0.05)


def _luminance(colour: str) -> float:
    shares = [int(colour[at : at + 2], 16) / 255.0 for at in (1, 3, 5)]
    linear = [share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def too_small_for_a_finger(seen: Seen) -> list[str]:
    return seen.page.evaluate(_SMALL)


def unreached_by_tab(seen: Seen, first: str) -> tuple[int, list[str], list[str]]:
    """Move through the page by Tab from its first element.

    Return the number of elements to reach, the elements that were not reached, and those whose focus, explanation or
    toolbar was invisible.
    """
    page = seen.page
    count = page.evaluate(_REACH)
    page.focus(first)
    page.keyboard.press("Tab")
    page.keyboard.press("Shift+Tab")
    for _ in range(count + BESIDE):
        page.keyboard.press("Tab")
    left, hidden = (page.evaluate(f"[...{which}].map((one) => one.outerHTML)") for which in ("unreached", "hidden"))
    return count, left, hidden


def on_paper(seen: Seen) -> tuple[dict, float]:
    """Return the layout of the page on A4, and the share of dark pixels."""
    page = seen.page
    page.set_viewport_size(A4_INSIDE)
    page.emulate_media(media="print")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    found = page.evaluate(_ON_PAPER)
    dots = Image.open(io.BytesIO(page.screenshot(full_page=True))).convert("L").histogram()
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    page.emulate_media(media="screen")
    return found, sum(dots[:DARK]) / sum(dots)
