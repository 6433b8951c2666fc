"""Parameter sets: the girdle of a cadaver or a person as a TOML file, with a source for each number.

Vectors and lengths are in mm, of a right shoulder: ``thorax`` and ``clavicle.sc_mm`` in the thorax frame, the other
points in the frame of their bone (thesis, Appendix A).
"""

import math
import os
import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from models.adapted_parameters import ADAPTED_PARAMETERS, HALF_WIDTHS_MM
from models.girdle import Girdle
from models.sets.number_sources import MEASURED, begins_with, range_mm, unread_range
from models.sets.set_geometry import SHORTEST_MM, check_geometry, warn_of_geometry
from motions.errors import InputError, did_you_mean, warn_input

FOLDER = Path(__file__).parent / "sets"
"""Folder of the shipped sets."""

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
        return begins_with(self.source.get(key, ""), MEASURED)

    def range_mm(self, key: str) -> float | None:
        """Return the range or SD at the end of a number's source, mm; None if the source states none."""
        return range_mm(self.source.get(key, ""))

    def of(self, _subject: str) -> "ParameterSet":
        """Return this set, which is the set of every subject (``models.person.family`` has sets per subject)."""
        return self


def model_names() -> tuple[str, ...]:
    """Return the names of the shipped sets, sorted."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load_model(name_or_path: str | os.PathLike[str]) -> ParameterSet:
    """Load a shipped set by its name, or a user's own file (a path with a folder or one that ends in .toml).

    Raises InputError where there is no such set or file, or where the file is not a complete girdle in mm. Issues an
    InputWarning where hardly anybody has such numbers.
    """
    file = os.fspath(name_or_path)
    return parameter_set(_document(model_file(name_or_path), file), file)


def model_file(name_or_path: str | os.PathLike[str]) -> Path:
    """Return the path that ``load_model`` reads. Raises InputError where there is no shipped set of this name."""
    return Path(name_or_path) if _is_path(name_or_path) else _shipped(os.fspath(name_or_path))


def parameter_set(document: dict[str, Any], file: str) -> ParameterSet:
    """Return the parameter set of the TOML document of a file. Raises InputError and warns as ``load_model`` does."""
    _check_keys(document, file)
    given = _NUMBERS | ({} if "ac_mm" not in document["clavicle"] else _OWN_AC)
    numbers = {key: _array(file, key, _value(document, key), kind) for key, kind in given.items()}
    widths, source = _half_widths_mm(document, file), _source(document, file)
    check_geometry(numbers, source, file)
    girdle = _girdle(numbers)
    warn_of_geometry(girdle, numbers, source, file)
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
        if unread := unread_range(text):
            cause = f"the range at the end of the source of {key} cannot be read ({unread}), so the number has none"
            warn_input(InputError(file, None, cause, "Write it in mm, as in +-1.2 mm"))
    return dict(source)
