"""Export of a girdle as a TOML file for ``load_model``, with the sections of ``models.parameter_sets``."""

import json
from collections.abc import Mapping
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from models.girdle import Girdle


def parameters_toml(
    name: str,
    comment: str,
    girdle: Girdle,
    points_mm: Float[np.ndarray, "3 points"],
    source: Mapping[str, str],
    bounds_mm: Mapping[str, float] | None = None,
) -> str:
    """Return the text of a girdle's file, with all digits of every number, so that loading gives the same girdle.

    ``comment``: the lines at the top. ``source``: the source of each number, by key. ``bounds_mm``: half widths of the
    section ``bounds``, by key, where they are not the default values.
    """
    g = girdle
    above = "".join(f"# {line}\n" for line in comment.splitlines())
    points = _points_lines(np.asarray(points_mm, float).tobytes(), points_mm.shape[1])
    bounds = "".join(f"{key} = {_toml(width)}\n" for key, width in (bounds_mm or {}).items())
    sources = "".join(f'"{key}" = {toml_text(words)}\n' for key, words in source.items())
    return f"""\
{above}name = {toml_text(name)}

[thorax]
centre_mm = {_toml(g.centre_mm)}
semi_axes_mm = {_toml(g.semi_axes_mm)}
points_mm = [
{points}]

[clavicle]
sc_mm = {_toml(g.sc_mm)}
{_clavicle(g.ac_mm)}
conoid_mm = {_toml(g.clavicle_conoid_mm)}

[scapula]
ts_mm = {_toml(g.ts_mm)}
ai_mm = {_toml(g.ai_mm)}
conoid_mm = {_toml(g.scapula_conoid_mm)}

[constraint]
ts_distance_mm = {_toml(g.ts_distance_mm)}
ai_distance_mm = {_toml(g.ai_distance_mm)}
conoid_length_mm = {_toml(g.conoid_length_mm)}
{chr(10) + "[bounds]" + chr(10) + bounds if bounds else ""}
[source]
{sources}"""


def _clavicle(ac_mm: Float[np.ndarray, "3"]) -> str:
    """Return the line with the clavicle's length, and one with the position of AC where AC is not on the axis."""
    if not np.any(ac_mm[1:]):
        return f"length_mm = {_toml(ac_mm[0])}"
    return f"length_mm = {_toml(np.linalg.norm(ac_mm))}\nac_mm = {_toml(ac_mm)}"


@lru_cache(maxsize=16)
def _points_lines(points_mm: bytes, count: int) -> str:
    """Return the lines of the thorax points, cached: they are half of the text, and the same in all sets of a model."""
    points = np.frombuffer(points_mm).reshape(3, count)
    return "".join(f"    {_toml(point)},\n" for point in points.T)


def _toml(value: object) -> str:
    return json.dumps(np.asarray(value, dtype=float).tolist())


@lru_cache(maxsize=1024)
def toml_text(words: str) -> str:
    """Return a TOML basic string; the escapes of JSON are those of TOML, except for the delete character."""
    return json.dumps(words, ensure_ascii=False).replace("\x7f", "\\u007f")
