"""The mapping file (TOML): a laboratory's names of landmarks and angles, its unit and its axes."""

import tomllib
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from motions.errors import InputError, did_you_mean
from motions.table import LANDMARKS

THORAX = ("IJ", "PX", "C7", "T8")
"""Landmarks of the thorax frame, which every file of positions must have."""

MARKERS = (*THORAX, *LANDMARKS)
"""All landmarks in use (thesis, Appendix A)."""

MIDDLES = {"PX_T8": ("PX", "T8")}
"""Midpoints that replace two landmarks: the thorax frame needs only the midpoint of PX and T8."""

UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
"""Millimetres per unit of length, by the unit's name in files."""

UNIT_WORDS = {
    f"{prefix}met{ending}{s}": unit
    for prefix, unit in (("milli", "mm"), ("centi", "cm"), ("", "m"))
    for ending in ("er", "re")
    for s in ("", "s")
} | {"in": "inch", "inches": "inch"}
"""Units by the words that some programs write."""

CLUSTERS = ("thorax", "scapula", "humerus")
"""Segments that a cluster of markers may carry; a cluster on the skin of the clavicle cannot carry the clavicle."""

FEWEST_OF_CLUSTER = 3
"""Number of markers that determine a position and a rotation."""

BONES_BELOW = ("thorax", "clavicle")
"""Bones to which the angles of the scapula may be relative."""

_AXES = {f"{sign}{letter}": (place, -1.0 if sign else 1.0) for place, letter in enumerate("xyz") for sign in ("", "-")}
_KEYS = ("unit", "axes", "global", "scapula_relative_to", "markers", "columns", "clusters")
_EXAMPLE = 'Write lines such as unit = "mm" or, under [markers], IJ = "the name of your marker"'


@dataclass(frozen=True)
class Mapping:
    """Content of the mapping file. By default, landmarks and angles have this project's names."""

    unit: str | None = None
    """Unit of the positions; it overrides the unit in the data file."""
    axes: tuple[str, str, str] = ("x", "y", "z")
    """Axes of the file, with signs, that make a right-handed frame. Any of them may point up."""
    markers: dict[str, str] = field(default_factory=dict)
    """The laboratory's name of each landmark, or a formula of such names (``motions.landmarks.derived``)."""
    columns: dict[str, str] = field(default_factory=dict)
    """The laboratory's name of each angle."""
    clusters: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Markers of the cluster on each segment of CLUSTERS (``motions.landmarks.clusters``)."""
    scapula_relative_to: str = ""
    """Bone of BONES_BELOW to which the angles of the scapula in a .mot or .sto file are relative; empty if not
    stated."""
    global_axes: tuple[str, str, str] | None = None
    """Axes of the file that point to the right, upward and backward of a person who faces forward: the global frame of
    Appendix A. None if not stated."""

    def marker(self, landmark: str) -> str:
        """Return the name of a landmark in the file, or its formula."""
        middle = next((name for name, ends in MIDDLES.items() if landmark in ends and name in self.markers), landmark)
        return self.markers.get(middle, landmark)

    def column(self, angle: str) -> str:
        """Return the name of an angle in the file."""
        return self.columns.get(angle, angle)

    @property
    def R_lab_global(self) -> Float[np.ndarray, "3 3"] | None:
        """The axes of the global frame in the file's right-handed frame; None if the mapping does not state them."""
        if self.global_axes is None:
            return None
        return self.axes_matrix @ _rows(self.global_axes).T

    @property
    def axes_matrix(self) -> Float[np.ndarray, "3 3"]:
        """Matrix that converts a position in the file's axes into the right-handed frame."""
        return _rows(self.axes)


def _rows(axes: tuple[str, str, str]) -> Float[np.ndarray, "3 3"]:
    """Return the matrix with one named axis of the file per row."""
    matrix = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        place, sign = _AXES[axis]
        matrix[row, place] = sign
    return matrix


def read_mapping(path: Path | None) -> Mapping:
    """Read the mapping in a TOML file; without a file, return the default mapping. InputError if the file is wrong."""
    if path is None:
        return Mapping()
    file = str(path)
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        cause = f"the file cannot be read ({error.strerror})"
        raise InputError(file, None, cause, "Check the name of the mapping file") from error
    except (ValueError, RecursionError) as error:
        raise InputError(file, None, f"this is not a TOML file ({error})", _EXAMPLE) from error
    _check_keys(document, file)
    unit, axes = document.get("unit"), document.get("axes", ["x", "y", "z"])
    if unit is not None and unit not in tuple(UNITS_MM):  # a tuple, because a TOML value may be unhashable
        raise InputError(file, None, f"unit is {unit!r}", f"Write one of {', '.join(UNITS_MM)}")
    if not _is_frame(axes):
        remedy = 'Name x, y and z once each, negated where it must be, as in axes = ["x", "y", "-z"]'
        raise InputError(file, None, f"axes is {axes!r}", remedy)
    below = document.get("scapula_relative_to", "")
    if below not in ("", *BONES_BELOW):
        raise InputError(file, None, f"scapula_relative_to is {below!r}", f"Write one of {', '.join(BONES_BELOW)}")
    markers, columns = _names(document, "markers", file), _names(document, "columns", file)
    mapping = Mapping(unit, tuple(axes), markers, columns, _clusters(document, file), below)
    return mapping if "global" not in document else _with_global(mapping, document["global"], file)


def _with_global(mapping: Mapping, axes: object, file: str) -> Mapping:
    """Return the mapping with the global frame. InputError where the axes make no frame, or a left-handed one."""
    remedy = 'Name the axes of the file that point right, up and backward, as in global = ["x", "z", "-y"]'
    if not _is_frame(axes):
        raise InputError(file, None, f"global is {axes!r}", remedy)
    found = replace(mapping, global_axes=tuple(axes))  # type: ignore[arg-type]
    if found.R_lab_global is None or np.linalg.det(found.R_lab_global) < 0.0:
        raise InputError(file, None, f"global is {axes!r}, a left-handed frame", remedy)
    return found


def _clusters(document: dict, file: str) -> dict[str, tuple[str, ...]]:
    """Read the section ``clusters``. InputError if one is not a list of FEWEST_OF_CLUSTER or more different names."""
    table = document.get("clusters", {})
    example = 'Write lines such as scapula = ["AMC1", "AMC2", "AMC3"] under [clusters]'
    if not isinstance(table, dict):
        raise InputError(file, None, "clusters is not a section", example)
    for segment, names in table.items():
        if segment not in CLUSTERS:
            cause = f"there is no cluster {segment!r}"
            raise InputError(file, None, cause, f"Clusters are on {', '.join(CLUSTERS)}")
        if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
            raise InputError(file, None, f"cluster {segment} is not a list of markers", example)
        if len(set(names)) < max(FEWEST_OF_CLUSTER, len(names)):
            cause = f"cluster {segment} has not {FEWEST_OF_CLUSTER} different markers or more"
            raise InputError(file, None, cause, example)
    return {segment: tuple(names) for segment, names in table.items()}


def _check_keys(document: dict, file: str) -> None:
    """Raise InputError if a key is unknown, or if it is a landmark, which belongs under [markers]."""
    for key in document:
        if key in (*MARKERS, *MIDDLES):
            raise InputError(file, None, f"{key} stands outside [markers]", "Put the line [markers] above it")
        if key not in _KEYS:
            raise InputError(file, None, f"the key {key!r} is unknown", f"Known: {', '.join(_KEYS)}. {_EXAMPLE}")


def _is_frame(axes: object) -> bool:
    if not isinstance(axes, list) or len(axes) != 3 or not all(axis in _AXES for axis in axes):
        return False
    return sorted(axis.lstrip("-") for axis in axes) == ["x", "y", "z"]


def _names(document: dict, section: str, file: str) -> dict[str, str]:
    """Read a section of names. InputError if a key is unknown, or if two keys have the same name."""
    table = document.get(section, {})
    if not isinstance(table, dict) or not all(isinstance(name, str) and name for name in table.values()):
        raise InputError(file, None, f"{section} is not a section of names", _EXAMPLE)
    if section == "markers":
        _check_landmarks(table, file)
    for name in table.values():
        if list(table.values()).count(name) > 1:
            cause = f"{name!r} stands for two of [{section}]"
            raise InputError(file, None, cause, "Give each of them a name of its own")
    return dict(table)


def _check_landmarks(table: dict[str, str], file: str) -> None:
    """Raise InputError if a key is no landmark, or if a midpoint stands beside one of its landmarks."""
    for landmark in table:
        if landmark not in (*MARKERS, *MIDDLES):
            remedy = (
                f"{did_you_mean(landmark, (*MARKERS, *MIDDLES))}The landmarks are {', '.join((*MARKERS, *MIDDLES))}"
            )
            raise InputError(file, None, f"there is no landmark {landmark!r}", remedy)
        both = [end for end in MIDDLES.get(landmark, ()) if end in table]
        if both:
            cause = f"{landmark} and {both[0]} are both there, and {landmark} stands for {both[0]}"
            raise InputError(file, None, cause, "Remove one of the two lines")
