"""Content of a file of marker positions, and the landmarks in it, in millimetres."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from motions.checks.misfits import likely_unit, medians_mm
from motions.errors import InputError, listed, warn_input
from motions.landmarks.derived import factors_of, is_formula
from motions.landmarks.mapping import MARKERS, THORAX, UNIT_WORDS, UNITS_MM, Mapping

NEEDED = (*THORAX, "TS", "AI")
"""Landmarks without which there is no thorax frame or no scapula frame."""

_OF_ONE_BODY = (THORAX, ("AC", "AA", "TS", "AI"), ("EM", "EL"))
"""Landmarks of one segment. A prefix may name the segment or the person, so those of one segment have one prefix."""

_MOST_NAMED = 40
"""Maximum number of markers that a message lists."""

_FARTHEST = 1e9
"""Largest coordinate, in the unit of the file: a thousand kilometres in mm. Numbers near the largest float would
overflow in computations."""


@dataclass(frozen=True, eq=False)
class Markers:
    """Positions of all markers of a file, one row per frame or palpated posture; NaN is a gap.

    ``unit``: as the file states it, or None. ``names``: the markers in the order of the file, where a name may occur
    twice. ``rows``: columns that describe each row, such as subject, motion, posture; empty for a trial.
    """

    file: str
    names: tuple[str, ...]
    positions: Float[np.ndarray, "markers 3 frames"]
    unit: str | None
    rows: dict[str, list[str]]
    rate_hz: float | None = None
    """Frames per second, if the file states them."""


def landmarks_mm(markers: Markers, mapping: Mapping) -> dict[str, Float[np.ndarray, "3 frames"]]:
    """Find the landmarks in the file, by this project's names, mm, in the file's own frame made right-handed.

    A marker is found by its name, else without case, else behind a prefix as in ``P01:IJ``, or behind a prefix that all
    needed landmarks have. InputError if a needed landmark is absent, nowhere measured or there twice, if no unit is
    known, or if distances show that the unit is wrong. InputWarning if the markers of a segment have two prefixes.
    """
    factor = millimetres(markers, mapping)
    _check_there(markers, mapping)
    _check_prefixes(markers, mapping)
    found = landmarks_there_mm(markers, mapping, factor)
    for landmark in MARKERS:
        if landmark not in found and (landmark in NEEDED or landmark in mapping.markers):
            raise _absent(markers, mapping, landmark)
    if "AC" not in found and "AA" not in found:
        raise _absent(markers, mapping, "AC")
    check_size(markers.file, found, factor)
    return found


def landmarks_there_mm(markers: Markers, mapping: Mapping, factor: float) -> dict[str, Float[np.ndarray, "3 frames"]]:
    """Find the landmarks that the file has, mm. InputError if one is there twice. ``factor``: from ``millimetres``."""
    found = {}
    for landmark in MARKERS:
        position = _position(markers, mapping, landmark)
        if position is not None and np.isfinite(position).all(axis=0).any():
            _check_distance(markers, mapping.marker(landmark), position)
            found[landmark] = factor * (mapping.axes_matrix @ position)
    return found


def marker_mm(markers: Markers, mapping: Mapping, name: str, factor: float) -> Float[np.ndarray, "3 frames"] | None:
    """Return the positions of a marker, mm; None if the file lacks this marker. InputError if it is there twice."""
    position = _of_marker(markers, mapping, name, name)
    return None if position is None else factor * (mapping.axes_matrix @ position)


def names_of_landmarks(markers: Markers, mapping: Mapping) -> dict[str, str]:
    """Return the file's names of the landmarks found in it: markers, or the mapping's formulas unchanged."""
    wanted = {landmark: mapping.marker(landmark) for landmark in MARKERS}
    found = {landmark: _resolved(markers, mapping, name, landmark) for landmark, name in wanted.items()}
    return {
        landmark: name or wanted[landmark]
        for landmark, name in found.items()
        if name or (landmark in mapping.markers and is_formula(wanted[landmark]))
    }


def _check_there(markers: Markers, mapping: Mapping) -> None:
    """Raise one InputError that names all needed landmarks without a marker, if several, so that one run shows all."""

    def is_there(landmark: str) -> bool:
        name = mapping.marker(landmark)
        return _resolved(markers, mapping, name, landmark) is not None or is_formula(name)

    absent = [landmark for landmark in (*NEEDED, "AC") if not is_there(landmark)]
    if absent[-1:] == ["AC"] and is_there("AA"):
        absent.pop()
    if len(absent) > 1:
        cause = f"there are no markers for landmarks {', '.join(absent)}"
        first = nearest(absent[0], markers.names) or "the name of your marker"
        lines = f'under [markers] a line such as {absent[0]} = "{first}" for each'
        remedy = f"Name them in a mapping file (--map; --write-map makes one), {lines}; the file has {_listed(markers)}"
        if mapping.clusters:
            remedy += ". Clusters carry them with --static"
        raise InputError(markers.file, None, cause, remedy)


def _check_prefixes(markers: Markers, mapping: Mapping) -> None:
    """Warn if markers of one segment were found behind several prefixes, which may name several people."""
    found = names_of_landmarks(markers, mapping)
    for segment in _OF_ONE_BODY:
        chosen = [found[name] for name in segment if name in found and found[name] != mapping.marker(name)]
        by_prefix = {name.rpartition(":")[0]: name for name in chosen if ":" in name}
        if len(by_prefix) > 1:
            cause = f"markers {' and '.join(map(repr, by_prefix.values()))} are taken for one person"
            warn_input(InputError(markers.file, None, cause, "Name the right ones in a mapping file (--map)"))


def millimetres(markers: Markers, mapping: Mapping) -> float:
    """Return the millimetres per unit of the file: the mapping's unit, else the unit that the file states.

    InputError if neither states a unit, or if the unit is unknown. InputWarning where both differ.
    """
    said = (markers.unit or "").strip(" []()")
    stated = UNIT_WORDS.get(said.lower(), said.lower())
    if mapping.unit and stated not in ("", mapping.unit):
        cause = f"the file says that positions are in {said}; they are read as {mapping.unit}, as the mapping file says"
        warn_input(
            InputError(markers.file, None, cause, f'Remove unit = "{mapping.unit}" from it if the file is right')
        )
    unit = mapping.unit or stated
    if not unit:
        cause = "the file does not say in which unit the positions are"
        raise InputError(markers.file, None, cause, 'Write unit = "mm" or unit = "m" in a mapping file (--map)')
    if unit not in UNITS_MM:
        remedy = f"Correct it in the file, or write unit in a mapping file (--map); known are {', '.join(UNITS_MM)}"
        raise InputError(markers.file, None, f"the unit of the positions is {markers.unit!r}", remedy)
    return UNITS_MM[unit]


def _position(markers: Markers, mapping: Mapping, landmark: str) -> Float[np.ndarray, "3 frames"] | None:
    """Return the positions of a landmark in the file's unit and axes; None if the file lacks it."""
    name = mapping.marker(landmark)
    if _resolved(markers, mapping, name, landmark) is None and is_formula(name):
        return _derived(markers, mapping, name, landmark)
    return _of_marker(markers, mapping, name, landmark)


def _resolved(markers: Markers, mapping: Mapping, name: str, landmark: str) -> str | None:
    """Return the file's name of a marker; None if there is none. InputError if several names match."""
    if name in markers.names:
        return name
    together = (tuple(mapping.marker(needed) for needed in NEEDED), *mapping.clusters.values())
    prefixes = {_common_prefix(markers.names, names) for names in together}
    wanted = name.casefold()
    for spellings in ({wanted}, {f":{wanted}"}, {prefix + wanted for prefix in prefixes}):
        found = [own for own in dict.fromkeys(markers.names) if _is_spelled(own.casefold(), spellings)]
        if len(found) > 1:
            cause = f"markers {' and '.join(map(repr, found))} may both be {landmark}"
            raise InputError(markers.file, None, cause, f"Say in a mapping file (--map) which is {landmark}")
        if found:
            return found[0]
    return None


def _is_spelled(own: str, spellings: set[str]) -> bool:
    """Check whether a name is one of the spellings; a spelling that begins with a colon matches any prefix."""
    return own in spellings or f":{own.rpartition(':')[2]}" in spellings


@lru_cache
def _common_prefix(names: tuple[str, ...], together: tuple[str, ...]) -> str:
    """Find the prefix of all names that belong together, without case, which ends in no letter or digit. In files of
    QTM this prefix names the person. Empty if there is no such prefix, or more than one."""
    folded, needed = {name.casefold() for name in names}, [name.casefold() for name in together]
    before = {name.removesuffix(needed[0]) for name in folded if name.endswith(needed[0])}
    found = [one for one in before if one and not one[-1].isalnum() and all(one + name in folded for name in needed)]
    return found[0] if len(found) == 1 else ""


def _of_marker(markers: Markers, mapping: Mapping, name: str, landmark: str) -> Float[np.ndarray, "3 frames"] | None:
    own = _resolved(markers, mapping, name, landmark)
    if own is None:
        return None
    count = markers.names.count(own)
    if count > 1:
        remedy = f"Rename one of them, and say in a mapping file (--map) which is {landmark}"
        raise InputError(markers.file, None, f"there are {count} markers called {own!r}", remedy)
    return markers.positions[markers.names.index(own)]


def _derived(markers: Markers, mapping: Mapping, formula: str, landmark: str) -> Float[np.ndarray, "3 frames"] | None:
    """Compute a formula of the mapping file; None if one of its markers is absent. InputError if it is no formula."""
    position = np.zeros(markers.positions.shape[1:])
    for name, factor in _factors(markers, formula, landmark).items():
        part = _of_marker(markers, mapping, name, landmark)
        if part is None:
            return None
        position = position + factor * part
    return position


def _factors(markers: Markers, formula: str, landmark: str) -> dict[str, float]:
    try:
        return factors_of(formula)
    except ValueError as error:
        cause = f"{landmark} is {formula!r} in the mapping file, which is no marker and no formula: {error}"
        remedy = "Write a marker's name, or a formula such as 2*centijc7 - ij, (a + b)/2 or mean(a, b, c)"
        raise InputError(markers.file, None, cause, remedy) from error


def _check_distance(markers: Markers, name: str, position: Float[np.ndarray, "3 frames"]) -> None:
    """Raise InputError if a coordinate is impossible in every unit."""
    farthest = float(np.abs(position[np.isfinite(position)]).max())
    if farthest > _FARTHEST:
        cause = f"marker {name!r} has a coordinate of {farthest:.3g}"
        raise InputError(markers.file, None, cause, "Correct it, or leave it empty if it was not measured")


def _absent(markers: Markers, mapping: Mapping, landmark: str) -> InputError:
    """Return the error for a landmark that is absent or nowhere measured; it names the marker or one of its formula."""
    name = mapping.marker(landmark)
    if is_formula(name) and _resolved(markers, mapping, name, landmark) is None:
        parts = _factors(markers, name, landmark)
        name = next((part for part in parts if _resolved(markers, mapping, part, landmark) is None), name)
        measured = is_formula(name)
    else:
        measured = _resolved(markers, mapping, name, landmark) is not None
    if measured:
        cause, remedy = f"marker {name!r} ({landmark}) was nowhere measured", "Reconstruct it, or use another trial"
    else:
        cause = f"there is no marker {name!r} for landmark {landmark}"
        near = nearest(name, markers.names)
        guess = f"Is it {near!r}? " if near else ""
        remedy = f"{guess}Name it in a mapping file (--map), under [markers]; the file has {_listed(markers)}"
    if landmark == "AC":
        remedy = f"{remedy}. AA does too: AC is placed from it with --aa-to-ac kolz2020"
    return InputError(markers.file, None, cause, remedy)


def nearest(name: str, names: Sequence[str]) -> str:
    """Find the name most similar to this one, or a name that ends in it ('P01:IJ' for IJ); empty if there is none."""
    ending = [other for other in names if other.lower().endswith(name.lower())]
    return next(iter(difflib.get_close_matches(name, names, n=1) or ending), "")


def _listed(markers: Markers) -> str:
    return listed(markers.names, _MOST_NAMED)


def check_size(file: str, found: dict[str, Float[np.ndarray, "3 frames"]], factor: float) -> None:
    """Raise InputError if IJ and C7 are never measured together, or if all distances are a person's in another unit.

    ``factor``: millimetres per unit of the file.
    """
    if np.isnan(found["IJ"] + found["C7"]).any(axis=0).all():
        cause = "IJ and C7 are in no frame together: there is no thorax"
        raise InputError(file, None, cause, "Reconstruct them, or use another trial")
    unit = likely_unit(found, {unit: mm / factor for unit, mm in UNITS_MM.items()})
    if unit is not None:
        neck = medians_mm(found)["IJ", "C7"]
        cause = f"the distances between landmarks are no person's: IJ and C7 are {neck:.3g} mm apart"
        remedy = f'The positions look like {unit}: correct the unit, or write unit = "{unit}" in a mapping file (--map)'
        raise InputError(file, None, cause, f"{remedy}, which wins over the file")
