"""What a file of marker positions holds, and the landmarks in it in millimetres."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.checks.misfits import likely_unit, medians_mm
from motions.errors import InputError
from motions.landmarks.derived import factors_of, is_formula
from motions.landmarks.mapping import MARKERS, THORAX, UNITS_MM, Mapping

NEEDED = (*THORAX, "TS", "AI")
"""Without these there is neither a thorax nor a scapula frame."""

_FARTHEST = 1e9
"""A thousand kilometres in mm. Numbers near the largest that there are would overflow in what is made of them."""


@dataclass(frozen=True, eq=False)
class Markers:
    """Positions of all markers of a file, a row each frame or palpated posture; NaN is a gap.

    unit: as the file states it, or None. names: the file's markers in their order, where a name may stand twice.
    rows: what the file says of each row, by column, such as subject, motion, posture; empty for a trial.
    """

    file: str
    names: tuple[str, ...]
    positions: Float[np.ndarray, "markers 3 frames"]
    unit: str | None
    rows: dict[str, list[str]]


def landmarks_mm(markers: Markers, mapping: Mapping) -> dict[str, Float[np.ndarray, "3 frames"]]:
    """Find the landmarks of the file by their names here, mm, in the file's own (right-handed) frame.

    InputError if a needed one is not there, nowhere measured or there twice, if no unit is known, or if distances show
    that it is not the right one.
    """
    factor = _millimetres(markers, mapping)
    _check_there(markers, mapping)
    found = {}
    for landmark in MARKERS:
        position = _position(markers, mapping, landmark)
        if position is not None:
            _check_distance(markers, mapping.marker(landmark), position)
            found[landmark] = factor * (mapping.axes_matrix @ position)
    if "AC" not in found and "AA" not in found:
        _not_there(markers, mapping.marker("AC"), "AC")
    _check_size(markers, found, factor)
    return found


def _check_there(markers: Markers, mapping: Mapping) -> None:
    """InputError that names them all where several needed landmarks have no marker: one by one would take many runs."""

    def is_there(landmark: str) -> bool:
        name = mapping.marker(landmark)
        return name in markers.names or is_formula(name)

    needed = (*NEEDED, "AC") if not is_there("AA") else NEEDED
    absent = [landmark for landmark in needed if not is_there(landmark)]
    if len(absent) > 1:
        cause = f"there are no markers for landmarks {', '.join(absent)}"
        first = _nearest(absent[0], markers.names) or "the name of your marker"
        lines = f'under [markers] a line such as {absent[0]} = "{first}" for each'
        remedy = f"Name them in a mapping file (--map), {lines}; the file has {_listed(markers)}"
        raise InputError(markers.file, None, cause, remedy)


def _millimetres(markers: Markers, mapping: Mapping) -> float:
    """Millimetres in the unit of the file, which is the file's word, or the mapping's where the file says nothing."""
    stated = markers.unit.strip().lower() if markers.unit else ""
    if stated and stated not in UNITS_MM:
        remedy = f"Correct it in the file; known are {', '.join(UNITS_MM)}"
        raise InputError(markers.file, None, f"the unit of the positions is {markers.unit!r}", remedy)
    if stated and mapping.unit and stated != mapping.unit:
        cause = f"the file says that positions are in {stated}, the mapping file {mapping.unit}"
        raise InputError(markers.file, None, cause, "Correct the one that is wrong")
    unit = stated or mapping.unit
    if not unit:
        cause = "the file does not say in which unit the positions are"
        raise InputError(markers.file, None, cause, 'Write unit = "mm" or unit = "m" in a mapping file (--map)')
    return UNITS_MM[unit]


def _position(markers: Markers, mapping: Mapping, landmark: str) -> Float[np.ndarray, "3 frames"] | None:
    """The positions of a landmark, None where the file has none and none is needed."""
    name = mapping.marker(landmark)
    if name not in markers.names and is_formula(name):
        position = _derived(markers, name, landmark)
    else:
        position = _of_marker(markers, name, landmark)
    if position is None or not np.isfinite(position).all(axis=0).any():
        if landmark in NEEDED or landmark in mapping.markers:
            _not_there(markers, name, landmark)
        return None
    return position


def _of_marker(markers: Markers, name: str, landmark: str) -> Float[np.ndarray, "3 frames"] | None:
    count = markers.names.count(name)
    if count > 1:
        remedy = f"Rename one of them, and say in a mapping file (--map) which is {landmark}"
        raise InputError(markers.file, None, f"there are {count} markers called {name!r}", remedy)
    return markers.positions[markers.names.index(name)] if count else None


def _derived(markers: Markers, formula: str, landmark: str) -> Float[np.ndarray, "3 frames"]:
    """The sum that a mapping file writes. InputError if it is none, or if one of its markers is not there."""
    try:
        factors = factors_of(formula)
    except ValueError as error:
        cause = f"{landmark} is {formula!r} in the mapping file, which is no marker and no formula: {error}"
        remedy = "Write a marker's name, or a formula such as 2*centijc7 - ij, (a + b)/2 or mean(a, b, c)"
        raise InputError(markers.file, None, cause, remedy) from error
    position = np.zeros(markers.positions.shape[1:])
    for name, factor in factors.items():
        part = _of_marker(markers, name, landmark)
        if part is None:
            _not_there(markers, name, landmark)
        else:
            position = position + factor * part
    return position


def _check_distance(markers: Markers, name: str, position: Float[np.ndarray, "3 frames"]) -> None:
    """InputError if a marker is where none can be, in any unit."""
    farthest = float(np.abs(position[np.isfinite(position)]).max())
    if farthest > _FARTHEST:
        cause = f"marker {name!r} has a coordinate of {farthest:.3g}"
        raise InputError(markers.file, None, cause, "Correct it, or leave it empty if it was not measured")


def _not_there(markers: Markers, name: str, landmark: str) -> None:
    if name in markers.names:
        cause, remedy = f"marker {name!r} ({landmark}) was nowhere measured", "Reconstruct it, or use another trial"
    else:
        cause = f"there is no marker {name!r} for landmark {landmark}"
        near = _nearest(name, markers.names)
        guess = f"Is it {near!r}? " if near else ""
        remedy = f"{guess}Name it in a mapping file (--map), under [markers]; the file has {_listed(markers)}"
    if landmark == "AC":
        remedy = f"{remedy}. AA does too: AC is placed from it with --aa-to-ac kolz2020"
    raise InputError(markers.file, None, cause, remedy)


def _nearest(name: str, names: Sequence[str]) -> str:
    """The name most like it, or one such as 'P01:IJ' of marker IJ; empty where there is none."""
    ending = [other for other in names if other.lower().endswith(name.lower())]
    return next(iter(difflib.get_close_matches(name, names, n=1) or ending), "")


def _listed(markers: Markers) -> str:
    return ", ".join(markers.names[:40]) + (", ..." if len(markers.names) > 40 else "")


def _check_size(markers: Markers, found: dict[str, np.ndarray], factor: float) -> None:
    """InputError if there is no neck, or if all distances are a person's in another unit."""
    if np.isnan(found["IJ"] + found["C7"]).any(axis=0).all():
        cause = "IJ and C7 are in no frame together: there is no thorax"
        raise InputError(markers.file, None, cause, "Reconstruct them, or use another trial")
    unit = likely_unit(found, {unit: mm / factor for unit, mm in UNITS_MM.items()})
    if unit is not None:
        neck = medians_mm(found)["IJ", "C7"]
        cause = f"the distances between landmarks are no person's: IJ and C7 are {neck:.3g} mm apart"
        raise InputError(markers.file, None, cause, f"The positions look like {unit}: correct the unit")
