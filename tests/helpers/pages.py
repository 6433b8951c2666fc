"""Models and names for report pages in tests, and readers of the pages' data and text."""

import json
import re
from dataclasses import replace
from html import unescape
from typing import Any

import numpy as np
import pandas as pd
import pytest

from models import load_model
from motions import Motions

MODELS = [load_model("R2"), load_model("R4")]
R2 = MODELS[:1]

EVIL = "</script><script>alert(1)</script><b>&amp;"
"""Subject name that would run as a script if a page did not escape it."""


def data_of(html: str) -> dict[str, Any]:
    """Read the data that the script of the page uses."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.DOTALL)
    assert found
    return json.loads(found.group(1), parse_constant=lambda word: pytest.fail(f"{word} is not strict JSON"))


def words_of(html: str) -> str:
    """Return the text of the page before any script runs, on one line."""
    body = html[html.index("<main>") : html.index("</main>")]
    return one_line(body)


def sentences_of(html: str) -> list[str]:
    """List the sentences of the page's headings, paragraphs and lists."""
    parts = re.findall(
        r"<(h1|h2|h3|p|li|dd)\b[^>]*>(.*?)</\1>", html[html.index("<main>") : html.index("</main>")], re.DOTALL
    )
    return [one for _, part in parts for one in re.split(r"(?<=[.!?]) ", one_line(part).strip())]


def one_line(html: str) -> str:
    """Return the text of a part of a page on one line; explanations shown on hover do not split their sentence."""
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]*>", " ", re.sub(r"</?abbr[^>]*>", "", html))))


def simulated(motions: Motions, subjects: int) -> Motions:
    """Mark the rows of the first subjects as simulated."""
    origin = np.where(np.isin(motions.subject, motions.subjects[:subjects]), "simulated", "")
    return replace(motions, extra=pd.DataFrame({"origin": origin}))
