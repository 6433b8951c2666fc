"""Figures as SVG text, in one style, with the same bytes for the same numbers."""

import io
from collections.abc import Callable
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",  # text stays text: small and searchable
    "svg.hashsalt": "girdle",  # without a salt the ids change from run to run
    "text.parse_math": False,  # names from files are drawn as they are
    "font.sans-serif": ["DejaVu Sans", "Verdana", "Arial"],  # matplotlib brings the first: one layout everywhere
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
}

NOTE = {"color": "0.35", "fontsize": 7.5}
"""Style of explanatory text."""

ORANGE, BLUE, GREEN = "#e69f00", "#0072b2", "#009e73"
"""Colours of Okabe and Ito, which colour-blind readers can tell apart; in grey print their lightness differs."""


def svg(draw: Callable[[], Figure]) -> str:
    """Draw the figure that ``draw`` returns as SVG text, in the style ``STYLE``."""
    with mpl.rc_context(STYLE):
        text = io.StringIO()
        draw().savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
