"""Window that shows slices, takes the clicks of one contour, and draws the contour found so far.

Left button: add a click. Right button: remove the last click in this slice. n and p: next and previous slice. c: the
next three clicks are a correction (from and to on the contour, and via). d: the next clicks draw a contour, as at the
start. Close the window to end.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.backend_bases import KeyEvent, MouseButton, MouseEvent
from matplotlib.backends.registry import BackendFilter, backend_registry

from models.person.contours.band import Settings
from models.person.contours.click_table import CORRECT, DIGITS, DRAW, Click, Label, by_slice
from models.person.contours.edge_path import Line, Slopes, slopes_of
from models.person.contours.image_slices import ImageSlice
from models.person.contours.slice_stack import follow
from motions.errors import InputError

_HELP = "left: click, right: take back, n/p: slice, c: correct (from, to, via), d: draw; close to end"

_MOST_SLOPES = 100
"""Largest number of slices whose slopes are kept: 4 MB per slice of 512 x 512."""


def require_screen() -> None:
    """Raise an InputError where matplotlib cannot show a window."""
    if plt.get_backend().lower() not in backend_registry.list_builtin(BackendFilter.INTERACTIVE):
        cause = f"matplotlib shows no window here (its backend is {plt.get_backend()})"
        raise InputError(
            "--click", None, cause, "Run it where there is a screen, or give --clicks a file without --click"
        )


class ClickWindow:
    """Window of the clicks; ``clicks`` holds the clicks of all contours so far."""

    def __init__(self, slices: Sequence[ImageSlice], clicks: Sequence[Click], label: Label, settings: Settings):
        self.clicks, self.current, self.use = list(clicks), 0, DRAW
        self._slices, self._label, self._settings = slices, label, settings
        self._slopes: Callable[[int], Slopes] = lru_cache(_MOST_SLOPES)(lambda k: slopes_of(slices[k].grey))
        self.figure, self._axes = plt.subplots()
        canvas = self.figure.canvas
        if canvas.manager is not None and canvas.manager.key_press_handler_id is not None:
            canvas.mpl_disconnect(canvas.manager.key_press_handler_id)  # the window has its own keys
        canvas.mpl_connect("button_press_event", self._pressed)
        canvas.mpl_connect("key_press_event", self._typed)
        self._draw()

    @property
    def contour(self) -> Line | None:
        """Contour in the displayed slice from the clicks so far; None where there is no contour yet."""
        mine = [one for one in self.clicks if one.label == self._label]
        try:
            clicks = by_slice(mine, "the clicks").get(self._label, {})
            first = min(k for k, one in clicks.items() if one.drawn is not None)
            found = follow(self._slopes, max(first, self.current) + 1, clicks, self._settings)
        except ValueError:  # too few clicks
            return None
        return found[self.current].points_px

    def _pressed(self, event: MouseEvent) -> None:
        if event.inaxes is not self._axes or event.xdata is None or event.ydata is None:
            return
        if event.button == MouseButton.LEFT:
            x_px, y_px = round(float(event.xdata), DIGITS), round(float(event.ydata), DIGITS)
            self.clicks.append(Click(self._label, self.current, x_px, y_px, self.use))
        elif event.button == MouseButton.RIGHT:
            mine = [k for k, one in enumerate(self.clicks) if (one.label, one.slice) == (self._label, self.current)]
            if mine:
                self.clicks.pop(mine[-1])
        self._draw()

    def _typed(self, event: KeyEvent) -> None:
        if event.key in ("n", "p"):
            self.current = int(np.clip(self.current + (1 if event.key == "n" else -1), 0, len(self._slices) - 1))
            self.use = DRAW
        elif event.key in ("c", "d"):
            self.use = CORRECT if event.key == "c" else DRAW
        self._draw()

    def _draw(self) -> None:
        axes, shown = self._axes, self._slices[self.current]
        axes.clear()
        axes.imshow(shown.grey, cmap="gray", interpolation="nearest")
        contour = self.contour
        if contour is not None:
            axes.plot(*np.concatenate([contour, contour[:, :1]], axis=1), color="tab:orange", linewidth=1.0)
        for use, mark in ((DRAW, "+"), (CORRECT, "x")):
            here = [one for one in self.clicks if (one.label, one.slice, one.use) == (self._label, self.current, use)]
            axes.plot([one.x_px for one in here], [one.y_px for one in here], mark, color="tab:cyan")
        axes.set_title(
            f"slice {self.current + 1} of {len(self._slices)}, {self._label.surface}, {self.use}", fontsize=9
        )
        axes.set_xlabel(_HELP, fontsize=7)
        self.figure.canvas.draw_idle()
