"""Checks of the numbers of a parameter set: refused where nobody has them, warned of where hardly anybody has.

Numbers in mm by ``section.key``, of a right shoulder, in the frames of the thesis, Appendix A. An adapted number
may lie farther off, because an adaptation pays with it for what the model leaves out, and reports implausible values.
"""

from collections.abc import Iterator, Mapping

import numpy as np
from jaxtyping import Float

from models.adapted_parameters import ELLIPSOID
from models.ellipsoid import signed_distance_mm
from models.girdle import Girdle, bone_rotations, landmarks
from models.sets.number_sources import ADAPTED_TO, begins_with
from motions.checks.distances import FROM_IJ_MM
from motions.errors import InputError, warn_input
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from motions.table import ANGLES

SHORTEST_MM = 1.0
"""Lower limit of lengths and semi-axes, also of adapted ones: at 0 the distance to the ellipsoid and the direction of
the conoid have no derivative, and no bone, chest or ligament is nearly that short."""

SMALLEST_THORAX_MM = 50.0
"""Lower limit of the longest semi-axis: a newborn's chest, 330 mm around, is wider. A shorter axis is not in mm (the
longest of the thesis, in cm, is 40.4)."""

WIDEST_MM = 250.0
"""Upper limit of A_x: the sets have 133 to 153 (Tables 3.3, 4.5), and an adaptation adds up to 30; whole axes have 266
and more."""

DEEPEST = 1.2
"""Largest plausible A_z over A_x: 0.61 to 0.95 in the sets. With A_z doubled, or exchanged with A_y, they have 1.23 and
more."""

_NO_LIMIT = float("inf")

PLACES = {
    ("scapula.ts_mm", 0): (-_NO_LIMIT, 0.0, "TS is medial of AC"),
    ("scapula.ts_mm", 1): (-60.0, 20.0, "TS is on the x axis of the scapula frame"),
    ("scapula.ts_mm", 2): (-60.0, 20.0, "TS is on the x axis of the scapula frame"),
    ("scapula.ai_mm", 1): (-_NO_LIMIT, 0.0, "AI is below AC"),
    ("scapula.ai_mm", 2): (-60.0, 20.0, "AI has z = 0 in the scapula frame"),
    ("scapula.conoid_mm", 0): (-_NO_LIMIT, 0.0, "the conoid is medial of AC"),
    ("scapula.conoid_mm", 2): (-_NO_LIMIT, 0.0, "the conoid is in front of the plane of AC, TS and AI"),
    ("thorax.centre_mm", 1): (-_NO_LIMIT, 0.0, "the middle of the thorax is below IJ"),
    ("thorax.centre_mm", 2): (0.0, _NO_LIMIT, "the thorax is behind IJ"),
}
"""Least and largest value of a coordinate in every right shoulder, with the reason (thesis, Appendix A), by key and
index. TS and AI of das3 are contact points, up to 23 mm below and 35 mm in front of the landmarks, never behind them;
its limits leave 20 mm more."""

DOUBTFUL_PLACES = {
    ("clavicle.sc_mm", 0): (-10.0, _NO_LIMIT, "SC is to the right of IJ"),
    ("clavicle.sc_mm", 1): (-_NO_LIMIT, 30.0, "SC is beside IJ or below"),
    ("scapula.ai_mm", 0): (-_NO_LIMIT, 0.0, "AI is medial of AC"),
    ("scapula.conoid_mm", 1): (-_NO_LIMIT, 10.0, "the conoid is below AC"),
}
"""The same, for places that differ more, so that a value outside is only warned of. The sets have SC at x = 1 to 21 and
y = -15 to -7, AI at x = -148 to -136, and the conoid at y = -12 to -8 with a range of 8 mm."""

ADAPTED_SLACK_MM = 50.0
"""Margin by which an adapted number may lie beyond these limits: adaptations with own bones to measured shoulders move
such a coordinate by up to 31 mm."""

FEWEST_POINTS = len(ELLIPSOID) + 1
"""Least number of thorax points: one more than the unknowns of the geometric fit."""

FLATTEST_POINTS_MM = 1.0
"""Least root mean square distance of thorax points from their best line and plane: 44 and 14 mm in the sets. On a flat
patch the ellipsoid has no least D."""

FARTHEST_POINTS_MM = 40.0
"""Largest plausible root mean square distance of thorax points from the ellipsoid of the same set. Adaptations to
measured shoulders leave 14 mm at most; with y and z exchanged, or z turned round, the sets have 62 and more."""

FLATTEST_SCAPULA_MM = 1.0
"""Least distance of TS or AI, the one nearer to AC, to the line through AC and the farther one: the noise of
palpation."""

SAME_LENGTH_MM = 0.1
"""Largest difference between the length of ``clavicle.ac_mm`` and ``clavicle.length_mm``: both may be rounded to
tenths."""

SIZES_MM = {
    "clavicle.sc_mm": (4.0, 60.0),
    "clavicle.length_mm": (30.0, 250.0),
    "clavicle.conoid_mm": (20.0, 250.0),
    "scapula.ts_mm": (24.0, 250.0),
    "scapula.ai_mm": (30.0, 370.0),
    "scapula.conoid_mm": (8.0, 120.0),
    "thorax.semi_axes_mm": (SHORTEST_MM, 2000.0),
    "constraint.conoid_length_mm": (3.0, 90.0),
    "constraint.ts_distance_mm": (-75.0, 150.0),
    "constraint.ai_distance_mm": (-75.0, 150.0),
}
"""Smallest and largest length: from a fifth of an adult's, which is below a newborn's but above any adult's in
centimetres, to about twice an adult's. Adults: clavicle 149 (SD 12) and 161 (11) mm, growing by 8.4 mm per year from
birth to 12 (McGraw 2009, doi 10.1097/BPO.0b013e3181c11992); spine of the scapula 134 (12), length of the scapula 155
(16) mm (von Schroeder 2001, Clin Orthop 383:131). The other limits are from the thesis (Tables 3.1-3.3, 4.2), with five
times its longest semi-axis and three times its longest distance to the thorax; inside it, half of that: a child of half
the size has its AI up to 72 mm inside the thorax of R2."""

LEAST_DEPTH = 0.2
"""Lower limit of the distance of IJ from the ellipsoid's centre, over the distance of the surface in that direction.
The ratio is 0.84 and more in the shipped sets, 0.26 with the parameters of one set at the bounds of an adaptation, and
0.1 where the centre alone is in centimetres."""

CONOID_SLACK_MM = 20.0
"""Margin by which the conoid length may lie outside the distances that its attachments have at the mean rest posture,
over all axial rotations of the clavicle. In the shipped sets, and after adaptations of them, it lies within these; with
the scapular attachment behind the bone or lateral of it, 29 mm and more outside."""

_FRAMES = "Give a right shoulder in the frames of docs/frames.md"

Numbers = Mapping[str, Float[np.ndarray, "..."]]

Places = Mapping[tuple[str, int], tuple[float, float, str]]


def check_geometry(numbers: Numbers, source: Mapping[str, str], file: str) -> None:
    """Raise InputError where no girdle has such numbers. A conoid that closes the chain in no posture is accepted; its
    postures come out unreachable. Adapted sizes are not checked: they do not suggest another unit."""
    _check_unit(numbers["thorax.semi_axes_mm"], file)
    for key in ("thorax.semi_axes_mm", "clavicle.length_mm", "constraint.conoid_length_mm"):
        _check_length(key, float(np.min(numbers[key])), file)
    M_x = numbers["thorax.centre_mm"][0]
    if M_x != 0.0:
        remedy = "centre_mm must start with 0.0: the ellipsoid is symmetric about the midsagittal plane (A4)"
        raise InputError(file, None, f"thorax.centre_mm starts with {M_x:g}", remedy)
    length_mm = numbers["clavicle.length_mm"]
    if abs(np.linalg.norm(numbers.get("clavicle.ac_mm", length_mm)) - length_mm) > SAME_LENGTH_MM:
        cause = f"clavicle.length_mm is {length_mm:g}, and clavicle.ac_mm another length from SC"
        raise InputError(file, None, cause, "Make ac_mm as long as length_mm, or leave it out: AC is on the axis then")
    for key, limits_mm in SIZES_MM.items():
        if not _is_adapted(source, key):
            _check_size(key, numbers[key], limits_mm, file)
    _check_axes(float(numbers["thorax.semi_axes_mm"][0]), file)
    for doubt in _misplaced(PLACES, numbers, source, file):
        raise doubt
    _check_centre(numbers["thorax.centre_mm"], numbers["thorax.semi_axes_mm"], file)
    _check_points(numbers["thorax.points_mm"], file)
    if _off_line_mm(numbers["scapula.ts_mm"], numbers["scapula.ai_mm"]) < FLATTEST_SCAPULA_MM:
        remedy = "Give ts_mm and ai_mm in the scapula frame, from AC"
        raise InputError(file, None, "AC, TS and AI of the scapula lie on a line", remedy)
    if not _is_adapted(source, "clavicle.length_mm"):
        _check_clavicle(numbers["clavicle.conoid_mm"][0], float(length_mm), file)


def warn_of_geometry(girdle: Girdle, numbers: Numbers, source: Mapping[str, str], file: str) -> None:
    """Warn (InputWarning) where hardly anybody has such numbers."""
    for doubt in _misplaced(DOUBTFUL_PLACES, numbers, source, file):
        warn_input(doubt)
    if not any(_is_adapted(source, key) for key in ("thorax.centre_mm", "thorax.semi_axes_mm")):
        _warn_of_thorax(numbers, file)
    if not any(_is_adapted(source, f"{bone}.conoid_mm") for bone in ("clavicle", "scapula")):
        _warn_of_conoid(girdle, file)


def _is_adapted(source: Mapping[str, str], key: str) -> bool:
    """Check whether a number was adapted, to this person or, in the parentheses of its source, to another one."""
    said = source.get(key, "")
    return begins_with(said, ADAPTED_TO) or f"({ADAPTED_TO}" in said


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
    of_vector = np.max if key == "thorax.semi_axes_mm" else np.linalg.norm
    size_mm = float(of_vector(number_mm) if np.ndim(number_mm) else number_mm)
    least, most = limits_mm
    if least <= size_mm <= most or size_mm == 0.0:  # other checks explain a 0 better
        return
    cause = f"{key} is {size_mm:.4g} mm, {'less' if size_mm < least else 'more'} than in any person"
    remedy = f"{_likely_unit(size_mm, limits_mm)}Give it in mm: between {least:g} and {most:g}"
    raise InputError(file, None, cause, remedy)


def _likely_unit(size_mm: float, limits_mm: tuple[float, float]) -> str:
    """Name the unit in which a length would be within the limits, as the beginning of a remedy; empty if none would, or
    if 0 is within them."""
    least, most = limits_mm
    units = {"centimetres": 10.0, "metres": 1000.0, "tenths of a millimetre": 0.1, "micrometres": 0.001}
    unit = next((name for name, factor in units.items() if 0.0 < least <= factor * size_mm <= most), None)
    return f"It looks like {unit}. " if unit else ""


def _misplaced(places: Places, numbers: Numbers, source: Mapping[str, str], file: str) -> Iterator[InputError]:
    """Yield an error for each coordinate out of its limits, which belongs to another frame or to a left shoulder."""
    for (key, axis), (least, most, where) in places.items():
        slack = ADAPTED_SLACK_MM if _is_adapted(source, key) else 0.0
        number = float(numbers[key][axis])
        if not least - slack <= number <= most + slack:
            cause = f"{key} has {'xyz'[axis]} = {number:g}, but {where}"
            yield InputError(file, None, cause, _FRAMES)


def _check_points(points_mm: Float[np.ndarray, "points 3"], file: str) -> None:
    """Raise InputError where no ellipsoid can be fitted to the points, or no person has them."""
    if len(points_mm) < FEWEST_POINTS:
        remedy = f"Give {FEWEST_POINTS} or more: the fit of the ellipsoid has {len(ELLIPSOID)} unknowns"
        raise InputError(file, None, f"thorax.points_mm has {len(points_mm)} points", remedy)
    from_ij_mm, (least, most) = np.linalg.norm(points_mm, axis=1), FROM_IJ_MM
    k, middle_mm = int(np.argmax(from_ij_mm)), float(np.median(from_ij_mm))
    if not least <= from_ij_mm[k] <= most:
        cause = f"of thorax.points_mm the farthest, number {k + 1}, is {from_ij_mm[k]:.4g} mm from IJ"
        unit = "" if least <= middle_mm <= most else _likely_unit(middle_mm, FROM_IJ_MM)  # one point has no own unit
        raise InputError(file, None, cause, f"{unit}Give points in mm: the farthest is {least:g} to {most:g} away")
    spread_mm = np.linalg.svd(points_mm - points_mm.mean(axis=0), compute_uv=False) / np.sqrt(len(points_mm))
    if spread_mm[2] < FLATTEST_POINTS_MM:
        shape = "plane" if spread_mm[1] >= FLATTEST_POINTS_MM else "line"
        cause = f"thorax.points_mm lie on a {shape}, and no ellipsoid is closest to them"
        raise InputError(file, None, cause, "Give points all over the right side of the thorax")


def _warn_of_thorax(numbers: Numbers, file: str) -> None:
    """Warn of an ellipsoid that is too deep, or far off the points of its own fit."""
    centre_mm, semi_axes_mm = numbers["thorax.centre_mm"], numbers["thorax.semi_axes_mm"]
    if semi_axes_mm[2] > DEEPEST * semi_axes_mm[0]:
        cause = (
            f"thorax.semi_axes_mm says {semi_axes_mm[2]:g} mm deep and {semi_axes_mm[0]:g} wide: no thorax is so deep"
        )
        warn_input(InputError(file, None, cause, "Give the semi-axes to the side, up and backward: half of the axes"))
    off_mm = signed_distance_mm(numbers["thorax.points_mm"].T, centre_mm[:, None], semi_axes_mm[:, None])
    off_mm = float(np.sqrt(np.mean(off_mm**2)))
    if off_mm > FARTHEST_POINTS_MM:
        cause = (
            f"thorax.points_mm are {off_mm:.0f} mm (root mean square) off the ellipsoid of centre_mm and semi_axes_mm"
        )
        warn_input(InputError(file, None, cause, "Give all of them in mm in the thorax frame of docs/frames.md"))


def _check_clavicle(x_mm: float, length_mm: float, file: str) -> None:
    if not 0.0 < x_mm < length_mm:
        cause = f"clavicle.conoid_mm has x = {x_mm:g}, not between SC at 0 and AC at {length_mm:g}"
        raise InputError(file, None, cause, "Give it in the clavicle frame, from SC")


def _warn_of_conoid(girdle: Girdle, file: str) -> None:
    """Warn of attachments that are farther apart, or nearer, than the conoid can bring them together at rest."""
    nearest, farthest = _conoid_at_rest_mm(girdle)
    length_mm = float(girdle.conoid_length_mm)
    if not nearest - CONOID_SLACK_MM <= length_mm <= farthest + CONOID_SLACK_MM:
        apart = f"the two points conoid_mm are {nearest:.0f} to {farthest:.0f} mm apart"
        cause = f"constraint.conoid_length_mm is {length_mm:.4g}, and at rest {apart}"
        warn_input(InputError(file, None, cause, "Check the length, and both points: docs/frames.md says which frames"))


def _conoid_at_rest_mm(girdle: Girdle) -> tuple[float, float]:
    """Compute the smallest and largest distance of the conoid's attachments at the mean rest posture."""
    angles = REST_DEG / DEG
    R_thorax_clavicle, _ = bone_rotations(angles * np.not_equal(ANGLES, "clavicle_x"))
    attachment = R_thorax_clavicle.T @ (landmarks(girdle, angles).scapula_conoid - girdle.sc_mm)
    return conoid_reach_mm(attachment, girdle.clavicle_conoid_mm)


def conoid_reach_mm(p: Float[np.ndarray, "3"], k: Float[np.ndarray, "3"]) -> tuple[float, float]:
    """Compute the smallest and largest |p - Rx(c) k| over the axial rotations c of the clavicle, with the scapular
    attachment p in its frame without axial rotation, and the clavicular attachment k."""
    along, one, other = p[0] - k[0], np.hypot(p[1], p[2]), np.hypot(k[1], k[2])
    return float(np.hypot(along, one - other)), float(np.hypot(along, one + other))


def _check_axes(A_x_mm: float, file: str) -> None:
    """Raise InputError where A_x is so large that the file seems to give whole axes."""
    if A_x_mm > WIDEST_MM:
        cause = f"thorax.semi_axes_mm starts with {A_x_mm:g} mm: no thorax is twice as wide"
        raise InputError(file, None, cause, "Give semi-axes, half of the axes")


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
