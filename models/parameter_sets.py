"""Parameter sets: the girdle of a cadaver or a person as a TOML file, with a source for each number.

Vectors and lengths are in mm, of a right shoulder: ``thorax`` and ``clavicle.sc_mm`` in the thorax frame, the other
points in the frame of their bone (thesis, Appendix A).
"""

import math
import os
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from models.adapted_parameters import ADAPTED_PARAMETERS, ELLIPSOID, HALF_WIDTHS_MM
from models.girdle import Girdle
from motions.errors import InputError, did_you_mean

FOLDER = Path(__file__).parent / "sets"
"""Folder of the shipped sets."""

SHORTEST_MM = 1.0
"""Lower limit of lengths and semi-axes, also of adapted ones: at 0 the distance to the ellipsoid and the direction of
the conoid have no derivative, and no bone, chest or ligament is nearly that short."""

SMALLEST_THORAX_MM = 50.0
"""Lower limit of the longest semi-axis: a newborn's chest, 330 mm around, is wider. A shorter axis is not in mm (the
longest of the thesis, in cm, is 40.4)."""

WIDEST_MM = 250.0
"""Upper limit of A_x: the sets have 133 to 153 (Tables 3.3, 4.5), and an adaptation adds up to 30; whole axes have 266
and more."""

SIDES = {
    "scapula.ts_mm": (0, -1, "TS is medial of AC"),
    "scapula.ai_mm": (1, -1, "AI is below AC"),
    "thorax.centre_mm": (2, 1, "the thorax is behind IJ"),
}
"""Index of a coordinate, its sign in every right shoulder and the reason (thesis, Appendix A), by key. SC is not in the
list because it may be beside IJ: in das3 it is at x = 1.4 mm."""

FEWEST_POINTS = len(ELLIPSOID) + 1
"""Least number of thorax points: one more than the unknowns of the geometric fit."""

FLATTEST_SCAPULA_MM = 1.0
"""Least distance of TS or AI, the one nearer to AC, to the line through AC and the farther one: the noise of
palpation."""

SAME_LENGTH_MM = 0.1
"""Largest difference between the length of ``clavicle.ac_mm`` and ``clavicle.length_mm``: both may be rounded to
tenths."""

ADAPTED_TO = "adapted to "
"""First words of the source of an adapted number."""

SIZES_MM = {
    "clavicle.sc_mm": (4.0, 60.0),
    "clavicle.length_mm": (30.0, 250.0),
    "clavicle.conoid_mm": (20.0, 250.0),
    "scapula.ts_mm": (24.0, 250.0),
    "scapula.ai_mm": (30.0, 370.0),
    "scapula.conoid_mm": (8.0, 120.0),
    "thorax.semi_axes_mm": (SHORTEST_MM, 2000.0),
    "constraint.conoid_length_mm": (SHORTEST_MM, 90.0),
    "constraint.ts_distance_mm": (0.0, 150.0),
    "constraint.ai_distance_mm": (0.0, 150.0),
}
"""Smallest and largest length: from a fifth of an adult's, which is below a newborn's but above any adult's in
centimetres, to about twice an adult's. Adults: clavicle 149 (SD 12) and 161 (11) mm, growing by 8.4 mm per year from
birth to 12 (McGraw 2009, doi 10.1097/BPO.0b013e3181c11992); spine of the scapula 134 (12), length of the scapula 155
(16) mm (von Schroeder 2001, Clin Orthop 383:131). The other limits are from the thesis (Tables 3.1-3.3, 4.2), with five
times its longest semi-axis and three times its longest distance to the thorax."""

LEAST_DEPTH = 0.2
"""Lower limit of the distance of IJ from the ellipsoid's centre, over the distance of the surface in that direction.
The ratio is 0.84 and more in the shipped sets, 0.26 with the parameters of one set at the bounds of an adaptation, and
0.1 where the centre alone is in centimetres."""

MEASURED = "measured"
"""First word of the source of a number that was measured on the person."""

_RANGE = re.compile(r"\+-\s*([0-9.]+)\s*mm$")
"""Pattern of the range at the end of a source; earlier in the text, a source may cite ranges of other numbers."""

_VECTOR, _POINTS, _LENGTH, _DISTANCE, _TEXT = "vector", "points", "length", "distance", "text"

_MEANING = {
    _VECTOR: "three numbers, [x, y, z]",
    _POINTS: "a list of points, [[x, y, z], ...]",
    _LENGTH: "one number",
    _DISTANCE: "one number",
    _TEXT: "text in quotes",
}

_NUMBERS = {
    "thorax.centre_mm": _VECTOR,
    "thorax.semi_axes_mm": _VECTOR,
    "thorax.points_mm": _POINTS,
    "clavicle.sc_mm": _VECTOR,
    "clavicle.length_mm": _LENGTH,
    "clavicle.conoid_mm": _VECTOR,
    "scapula.ts_mm": _VECTOR,
    "scapula.ai_mm": _VECTOR,
    "scapula.conoid_mm": _VECTOR,
    "constraint.ts_distance_mm": _DISTANCE,
    "constraint.ai_distance_mm": _DISTANCE,
    "constraint.conoid_length_mm": _LENGTH,
}
"""Required keys, as section.key, with the form of their values."""

_OWN_AC = {"clavicle.ac_mm": _VECTOR}
"""Optional key: position of AC in the measured frame of a person's clavicle, where AC is not on the axis."""

_BOUNDS = {f"bounds.{key}": _LENGTH for key in HALF_WIDTHS_MM}
"""Optional keys: half widths of the bounds."""

_SECTIONS = tuple(dict.fromkeys(key.partition(".")[0] for key in (*_NUMBERS, *_BOUNDS)))


@dataclass(frozen=True, eq=False, repr=False)
class ParameterSet:
    """One girdle, the thorax points of its ellipsoid's fit, and the bounds of an adaptation."""

    name: str
    girdle: Girdle
    """Girdle without a batch: vectors (3,), lengths ()."""
    points_mm: Float[np.ndarray, "3 points"]
    """Points on the thorax, thorax frame."""
    bounds_mm: Float[np.ndarray, "2 adapted"]
    """Lower and upper bounds in the order of ``ADAPTED_PARAMETERS``: own value -+ half width."""
    source: dict[str, str]
    """Source of each number, by ``section.key``. Empty where a user's own file names none."""

    def __repr__(self) -> str:
        return f"ParameterSet({self.name!r})"

    def is_measured(self, key: str) -> bool:
        """Check whether a number was measured on the person, according to its source (``models.person``)."""
        return self.source.get(key, "").startswith(MEASURED)

    def range_mm(self, key: str) -> float | None:
        """Return the range or SD at the end of a number's source, mm; None if the source states none."""
        stated = _RANGE.search(self.source.get(key, ""))
        return float(stated[1]) if stated else None

    def of(self, _subject: str) -> "ParameterSet":
        """Return this set, which is the set of every subject (``models.person.family`` has sets per subject)."""
        return self


def model_names() -> tuple[str, ...]:
    """Return the names of the shipped sets, sorted."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load_model(name_or_path: str | os.PathLike[str]) -> ParameterSet:
    """Load a shipped set by its name, or a user's own file (a path with a folder or one that ends in .toml).

    Raises InputError where there is no such set or file, or where the file is not a complete girdle in mm.
    """
    file = os.fspath(name_or_path)
    return parameter_set(_document(model_file(name_or_path), file), file)


def model_file(name_or_path: str | os.PathLike[str]) -> Path:
    """Return the path that ``load_model`` reads. Raises InputError where there is no shipped set of this name."""
    return Path(name_or_path) if _is_path(name_or_path) else _shipped(os.fspath(name_or_path))


def parameter_set(document: dict[str, Any], file: str) -> ParameterSet:
    """Return the parameter set of the TOML document of a file. Raises InputError as ``load_model`` does."""
    _check_keys(document, file)
    given = _NUMBERS | ({} if "ac_mm" not in document["clavicle"] else _OWN_AC)
    numbers = {key: _array(file, key, _value(document, key), kind) for key, kind in given.items()}
    widths, source = _half_widths_mm(document, file), _source(document, file)
    _check_geometry(numbers, source, file)
    girdle = _girdle(numbers)
    return ParameterSet(
        name=_name(document, file),
        girdle=girdle,
        points_mm=numbers["thorax.points_mm"].T,
        bounds_mm=_bounds_mm(np.asarray(girdle.adapted_mm), widths),
        source=source,
    )


def _is_path(name_or_path: str | os.PathLike[str]) -> bool:
    if not isinstance(name_or_path, str):
        return True
    return name_or_path.lower().endswith(".toml") or any(mark in name_or_path for mark in ("/", os.sep))


def _shipped(name: str) -> Path:
    known = model_names()
    if name in known:
        return FOLDER / f"{name}.toml"
    remedy = f"The sets are {', '.join(known)}; a file of your own ends in .toml"
    raise InputError(name, None, "there is no parameter set of this name", did_you_mean(name, known) + remedy)


def _document(path: Path, file: str) -> dict[str, Any]:
    try:
        content = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        remedy = "Check the path, and that you may read the file"
        raise InputError(file, None, f"the file cannot be read ({reason})", remedy) from error
    return parameter_document(content, file)


def parameter_document(content: bytes | str, file: str) -> dict[str, Any]:
    """Parse the content of a TOML file. Raises InputError where the content is not TOML."""
    try:
        return tomllib.loads(content if isinstance(content, str) else content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        reason = "it is not UTF-8 text" if isinstance(error, UnicodeDecodeError) else str(error)
        remedy = "Start from a copy of a shipped set and change its numbers"
        raise InputError(file, None, f"this is not a TOML file ({reason})", remedy) from error


def _value(document: dict[str, Any], key: str) -> Any:
    section, _, name = key.partition(".")
    return document[section][name]


def _check_keys(document: dict[str, Any], file: str) -> None:
    """Check for unknown and missing keys; for unknown ones first, as a misspelt key is also missing, and only its own
    name explains that."""
    _check_known(file, document, ("name", *_SECTIONS, "source"), "")
    for section in (*_SECTIONS, "source"):
        table = document.get(section, {})
        if not isinstance(table, dict):
            cause = f"{section} is {table!r} and must be a section"
            raise InputError(file, None, cause, f"Write [{section}] on a line of its own and its keys below it")
        _check_known(file, table, _keys_of(section), section)
    for key in ("name", *_NUMBERS):
        section, _, name = key.rpartition(".")
        if name not in (document.get(section, {}) if section else document):
            where = f"under [{section}]" if section else "as the first line"
            meaning = _MEANING[_NUMBERS.get(key, _TEXT)]
            raise InputError(file, None, f"the key {key} is missing", f"Add {name} = {meaning} {where}")


def _keys_of(section: str) -> tuple[str, ...]:
    known = (*_NUMBERS, *_OWN_AC, *_BOUNDS)
    if section == "source":
        return known
    return tuple(key.partition(".")[2] for key in known if key.startswith(section + "."))


def _check_known(file: str, table: dict[str, Any], known: tuple[str, ...], section: str) -> None:
    for key in table:
        if key not in known:
            where = f" in [{section}]" if section else ""
            names = (f'"{name}"' if "." in name else name for name in known)
            remedy = f"{did_you_mean(key, known)}Known{where}: {', '.join(names)}"
            raise InputError(file, None, f"the key {key!r}{where} is unknown", remedy)


def _array(file: str, key: str, value: Any, kind: str) -> Float[np.ndarray, "..."]:
    if not _has_form(value, kind):
        remedy = f"Write {key.rpartition('.')[2]} = {_MEANING[kind]}, numbers in mm without quotes"
        raise InputError(file, None, f"{key} is {_short(value)} and must be {_MEANING[kind]}", remedy)
    array = np.array(_floats(value))
    if not np.all(np.isfinite(array)):
        cause = f"{key} holds a number that is not finite ({_short(value)})"
        raise InputError(file, None, cause, "Give every number; the models have no unknown ones")
    return array


def _has_form(value: Any, kind: str) -> bool:
    if kind == _POINTS:
        return isinstance(value, list) and all(_has_form(point, _VECTOR) for point in value)
    if kind == _VECTOR:
        return isinstance(value, list) and len(value) == 3 and all(_has_form(v, _LENGTH) for v in value)
    return isinstance(value, int | float) and not isinstance(value, bool)


def _floats(value: Any) -> Any:
    """Convert the numbers of nested lists to float; an integer beyond the largest float becomes infinite."""
    if isinstance(value, list):
        return [_floats(v) for v in value]
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _check_geometry(numbers: dict[str, np.ndarray], source: Mapping[str, str], file: str) -> None:
    """Raise InputError where no girdle has such numbers. A conoid that closes the chain in no posture is accepted; its
    postures come out unreachable. Adapted sizes are not checked: the adaptation reports implausible ones, and they do
    not suggest another unit."""
    _check_unit(numbers["thorax.semi_axes_mm"], file)
    for key in ("thorax.semi_axes_mm", "clavicle.length_mm", "constraint.conoid_length_mm"):
        _check_length(key, float(np.min(numbers[key])), file)
    M_x, points = numbers["thorax.centre_mm"][0], len(numbers["thorax.points_mm"])
    if M_x != 0.0:
        remedy = "centre_mm must start with 0.0: the ellipsoid is symmetric about the midsagittal plane (A4)"
        raise InputError(file, None, f"thorax.centre_mm starts with {M_x:g}", remedy)
    if points < FEWEST_POINTS:
        remedy = f"Give {FEWEST_POINTS} or more: the fit of the ellipsoid has {len(ELLIPSOID)} unknowns"
        raise InputError(file, None, f"thorax.points_mm has {points} points", remedy)
    length_mm = numbers["clavicle.length_mm"]
    if abs(np.linalg.norm(numbers.get("clavicle.ac_mm", length_mm)) - length_mm) > SAME_LENGTH_MM:
        cause = f"clavicle.length_mm is {length_mm:g}, and clavicle.ac_mm another length from SC"
        raise InputError(file, None, cause, "Make ac_mm as long as length_mm, or leave it out: AC is on the axis then")
    for key, limits_mm in SIZES_MM.items():
        if not source.get(key, "").startswith(ADAPTED_TO):
            _check_size(key, numbers[key], limits_mm, file)
    _check_axes(float(numbers["thorax.semi_axes_mm"][0]), file)
    _check_sides(numbers, file)
    _check_centre(numbers["thorax.centre_mm"], numbers["thorax.semi_axes_mm"], file)
    if _off_line_mm(numbers["scapula.ts_mm"], numbers["scapula.ai_mm"]) < FLATTEST_SCAPULA_MM:
        remedy = "Give ts_mm and ai_mm in the scapula frame, from AC"
        raise InputError(file, None, "AC, TS and AI of the scapula lie on a line", remedy)


def _check_unit(semi_axes_mm: Float[np.ndarray, "3"], file: str) -> None:
    longest = float(np.max(semi_axes_mm))
    if np.min(semi_axes_mm) > 0.0 and longest < SMALLEST_THORAX_MM:
        cause = f"the longest of thorax.semi_axes_mm is {longest:g} mm, less than of any thorax"
        remedy = "Give every length in millimetres: metres times 1000, centimetres times 10"
        raise InputError(file, None, cause, remedy)


def _check_length(key: str, shortest_mm: float, file: str) -> None:
    if shortest_mm < SHORTEST_MM:
        cause = f"{key} is {shortest_mm:g} and must be at least {SHORTEST_MM:g} mm"
        raise InputError(file, None, cause, "Give lengths and semi-axes as positive numbers in millimetres")


def _check_size(key: str, number_mm: np.ndarray, limits_mm: tuple[float, float], file: str) -> None:
    """Raise InputError where no person has such a length; the message names the likely unit of the number."""
    size_mm = float(np.max(number_mm) if key == "thorax.semi_axes_mm" else np.linalg.norm(number_mm))
    least, most = limits_mm
    if least <= size_mm <= most or size_mm == 0.0:  # other checks explain a 0 better
        return
    cause = f"{key} is {size_mm:.4g} mm, {'less' if size_mm < least else 'more'} than in any person"
    units = {"centimetres": 10.0, "metres": 1000.0, "tenths of a millimetre": 0.1, "micrometres": 0.001}
    unit = next((name for name, factor in units.items() if least <= factor * size_mm <= most), None)
    guess = f"It looks like {unit}. " if unit else ""
    raise InputError(file, None, cause, f"{guess}Give it in mm: between {least:g} and {most:g}")


def _check_axes(A_x_mm: float, file: str) -> None:
    """Raise InputError where A_x is so large that the file seems to give whole axes."""
    if A_x_mm > WIDEST_MM:
        cause = f"thorax.semi_axes_mm starts with {A_x_mm:g} mm: no thorax is twice as wide"
        raise InputError(file, None, cause, "Give semi-axes, half of the axes")


def _check_sides(numbers: dict[str, np.ndarray], file: str) -> None:
    """Raise InputError where a sign belongs to another frame or to a left shoulder."""
    for key, (place, sign, where) in SIDES.items():
        number = numbers[key][place]
        if sign * number < 0.0:
            cause = f"{key.partition('.')[2]} has {'xyz'[place]} = {number:g}, but {where}"
            raise InputError(file, None, cause, "Give a right shoulder in the frames of docs/frames.md")


def _check_centre(centre_mm: Float[np.ndarray, "3"], semi_axes_mm: Float[np.ndarray, "3"], file: str) -> None:
    """Raise InputError where IJ, the origin, lies deep inside the ellipsoid."""
    if np.linalg.norm(centre_mm / semi_axes_mm) >= LEAST_DEPTH:
        return
    cause = f"thorax.centre_mm is {np.linalg.norm(centre_mm):.4g} mm from IJ, which then lies deep inside the ellipsoid"
    raise InputError(file, None, cause, "IJ is near its surface. Give the centre in mm: centimetres times 10")


def _off_line_mm(ts_mm: Float[np.ndarray, "3"], ai_mm: Float[np.ndarray, "3"]) -> float:
    """Compute the distance of TS or AI, the one nearer to AC (the origin), to the line through AC and the farther one,
    mm."""
    farther = max(np.linalg.norm(ts_mm), np.linalg.norm(ai_mm))
    return float(np.linalg.norm(np.cross(ts_mm, ai_mm)) / farther) if farther > 0.0 else 0.0


def _girdle(numbers: dict[str, np.ndarray]) -> Girdle:
    attached = {f"{bone}_conoid_mm": numbers[f"{bone}.conoid_mm"] for bone in ("clavicle", "scapula")}
    other = {key.partition(".")[2]: value for key, value in numbers.items()} | attached
    ac_mm = other.get("ac_mm", np.array([float(other["length_mm"]), 0.0, 0.0]))
    return Girdle(ac_mm=ac_mm, **{one.name: other[one.name] for one in fields(Girdle) if one.name != "ac_mm"})


def _half_widths_mm(document: dict[str, Any], file: str) -> Float[np.ndarray, " adapted"]:
    """Read the half widths in the order of ``ADAPTED_PARAMETERS``, with default values where the file has none."""
    given = document.get("bounds", {})
    keys = list(HALF_WIDTHS_MM)
    widths = [_array(file, f"bounds.{k}", given.get(k, HALF_WIDTHS_MM[k]), _LENGTH) for k in keys]
    for key, width in zip(keys, widths, strict=True):
        if width <= 0.0:
            cause = f"bounds.{key} is {width:g} and must be above 0"
            raise InputError(file, None, cause, "Give how far the parameter may go up or down, in mm")
    return np.array(widths)


def _bounds_mm(
    own_mm: Float[np.ndarray, " adapted"], half_mm: Float[np.ndarray, " adapted"]
) -> Float[np.ndarray, "2 adapted"]:
    """Compute own -+ half, with semi-axes and conoid length not below ``SHORTEST_MM``."""
    is_length = np.array([one.is_length for one in ADAPTED_PARAMETERS])
    lower = np.where(is_length, np.maximum(own_mm - half_mm, SHORTEST_MM), own_mm - half_mm)
    return np.stack([lower, own_mm + half_mm])


def _name(document: dict[str, Any], file: str) -> str:
    name = document["name"]
    if not isinstance(name, str) or not name.strip():
        remedy = 'Write name = "..." as the first line; the tables of results carry it'
        raise InputError(file, None, f"name is {_short(name)} and must be {_MEANING[_TEXT]}", remedy)
    return name


def _source(document: dict[str, Any], file: str) -> dict[str, str]:
    source = document.get("source", {})
    for key, text in source.items():
        if not isinstance(text, str):
            remedy = f'Write "{key}" = "where the number comes from" under [source]'
            raise InputError(file, None, f"the source of {key} is {_short(text)}, not {_MEANING[_TEXT]}", remedy)
    return dict(source)
