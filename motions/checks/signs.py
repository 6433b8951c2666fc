"""Checks of the signs of angles, from the girdle at rest and its motion while the arm rises.

An angle is r at rest and changes by s degrees over 60 degrees of elevation. In the population r and s
are normal with means m, n and SDs p, q. The odds of the present sign against the other one are exp(L),

    L = 2 r m / p^2 + 2 s n / q^2.

If L is below LEAST_LOG_ODDS, the other sign is likely. A term that was not measured, or whose mean is 0, is left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from motions.table import ANGLE_NAMES, ANGLES, Motions

LARGE_MOTION_DEG = 60.0
"""Minimum range of elevation within one motion, in degrees, for a change."""

LOW_DEG = 50.0
"""Elevation in degrees below which the girdle is near its rest: up to it the scapula alone turns by 20 degrees."""

NEAR_DEG = 2.0
"""Height in degrees above the lowest posture that still counts as rest, if no motion is large enough for a line."""

LEAST_LOG_ODDS = -1.5
"""Minimum log odds of the present sign: below it, the other one is likelier by 9 to 2. Measured and simulated motions
have 0.1 and more; by the normal distributions below, a sound angle falls below it in at most 1.5 % of people. If only
one of the two terms was measured, the limit is twice as far from 0."""


SURE_LOG_ODDS = -6.0
"""Log odds, 400 to 1, above which the present sign of tipping may be right: cadavers whose girdle closes only with a
scapula tipped by 4 +- 4 degrees backward (breteler_mri) cannot be told from people with the sign turned round."""


FAR_SD = 5.0
"""Deviation from people at rest, in SD, beyond which an angle with its sign turned round is wrong too: 40 degrees for
protraction of the clavicle."""


@dataclass(frozen=True)
class Usual:
    """Angle at rest and its change over 60 degrees of elevation, in degrees: means and SDs of people.

    A mean of 0 tells nothing about the sign.
    """

    rest: float
    rest_sd: float
    change: float
    change_sd: float
    source: str


_MEASURED = "twelve motions of six bone-pin shoulders (Moissenet 2023), means of Ludewig 2009 and Oki 2012"

USUAL: dict[str, Usual] = {
    "clavicle_y": Usual(
        -26.0, 8.0, -12.0, 8.0, f"Ludewig et al., JOSPT 34 (2004): retraction 15-29 deg at most; {_MEASURED}: -29 to -2"
    ),
    "clavicle_z": Usual(
        11.5, 6.0, 8.0, 5.0, f"Ludewig et al., JOSPT 34 (2004): elevation 11-15 deg at most; {_MEASURED}: 3 to 12"
    ),
    "clavicle_x": Usual(  # its zero is a convention
        0.0, 1.0, 11.0, 6.0, f"Ludewig et al., JOSPT 34 (2004): 15-31 deg backward at most; {_MEASURED}: 4 to 17"
    ),
    "scapula_y": Usual(
        40.0,
        12.0,
        0.0,
        1.0,
        "35 deg at AA, review of Struyf et al., Scand. J. Med. Sci. Sports 21 (2011) 352-358",
    ),
    "scapula_z": Usual(
        10.0,
        10.0,
        20.0,
        6.0,
        f"29 +- 10 deg from 25 to 125 deg, Dayanidhi et al., Clin. Biomech. 20 (2005) 600-606; {_MEASURED}: 9 to 29",
    ),
    "scapula_x": Usual(
        -9.0,
        5.0,
        3.0,
        6.0,
        "10 deg forward at rest, backward with elevation in most studies, Struyf et al. (2011); measured as above: -4 "
        "to -14 at rest, changes of -10 to 10",
    ),
}


_REST, _REST_SD, _CHANGE, _CHANGE_SD = np.array(
    [(one.rest, one.rest_sd, one.change, one.change_sd) for one in (USUAL[angle] for angle in ANGLES)]
).T
"""Values of USUAL as arrays in the order of ANGLES."""


EXCHANGED = 12.0
"""Difference of sums of squares, in SDs of people, by which exchanged angles must be likelier: odds of 400 to 1."""

SIGN_COST = 4.0
"""Penalty, as a sum of squares, on the explanation without an exchange, per sign that it turns round: one mistake is
likelier than two, assumed 7 to 1."""

FARTHEST_SD = 2.5
"""Maximum deviation of each term of the exchanged angles from people's, in SD."""


@dataclass(frozen=True)
class WrongSign:
    """Angle whose other sign is the likely one."""

    angle: str
    said: str
    log_odds: float
    far: bool = False
    """True where the angle with its sign turned round is no person's at rest either: by more than FAR_SD."""


@dataclass(frozen=True)
class Exchanged:
    """Angles whose columns are likely exchanged."""

    columns: tuple[str, ...]
    are: tuple[str, ...]
    """Angles that the columns hold."""

    @property
    def said(self) -> str:
        """Text that says which column holds which angle."""
        if len(self.columns) == 2:
            return f"{self.are[0]}_deg is as {self.are[1]}_deg is in people, and the other way round"
        pairs = zip(self.columns, self.are, strict=True)
        return f"in people {', '.join(f'{angle}_deg is as {column}_deg here' for column, angle in pairs)}"


_ELEVATIONS = Exchanged(("clavicle_z", "scapula_z"), ("scapula_z", "clavicle_z"))

BEYOND_SCAPULA_DEG = 8.0
"""Maximum excess of the clavicle's elevation over the lateral rotation of the scapula, which the clavicle carries, in
degrees per 60 degrees of the arm. Measured scapulae turn by at least 4 more than the clavicle, scapulae of simulated
girdles by at most 7 less."""


class RestAndChange(NamedTuple):
    """Angles of one subject with the arm low, and changes over 60 degrees of elevation, in degrees; NaN where unknown.

    The line of every angle over elevation in each motion has a change (``of_motions``) and a value at the lowest
    elevation (``starts``, NaN above LOW_DEG); ``large`` is true where the motion is large enough for a line.
    """

    rest: Float[np.ndarray, "6"]
    change: Float[np.ndarray, "6"]
    motions: tuple[str, ...]
    of_motions: Float[np.ndarray, "motions 6"]
    starts: Float[np.ndarray, "motions 6"]
    large: Bool[np.ndarray, "motions 6"]


def rest_and_change(motions: Motions) -> RestAndChange:
    """Compute the angles at rest and the changes of one subject, for all checks of signs."""
    elevation = motions.humerus_elevation_deg
    low = elevation <= min(LOW_DEG, _lowest(elevation) + NEAR_DEG)  # NaN compares false
    of_motions, starts, large = _lines(motions)
    has_line, count = large.any(axis=0), np.maximum(large.sum(axis=0), 1)
    change = np.where(has_line, np.where(large, of_motions, 0.0).sum(axis=0) / count, np.nan)
    rest = np.where(has_line, _medians(np.where(large, starts, np.nan)), _medians(motions.angles_deg[low]))
    return RestAndChange(rest, change, tuple(dict.fromkeys(motions.motion.tolist())), of_motions, starts, large)


def exchanged(found: RestAndChange, signs: Sequence[WrongSign]) -> Exchanged | None:
    """Find columns that are likely exchanged: two or three of one bone, or the elevations of clavicle and scapula.

    The criterion is people's angles at rest and changes. The exchange must be likelier than the present columns with
    the signs in ``signs`` turned round.
    """
    rest, change = found.rest, found.change
    turned = np.where(np.isin(ANGLES, [one.angle for one in signs]), -1.0, 1.0)
    mine, others = _squares(turned * rest, turned * change), _squares(rest[_ORDERS], change[_ORDERS])
    moved = np.arange(6) != _ORDERS
    known = np.isfinite(mine[:, None] + others) & moved
    possible = known.any(axis=(0, 2)) & (np.where(known, others, 0.0).max(axis=(0, 2)) <= FARTHEST_SD**2)
    likelier = np.where(known, mine[:, None] - others, 0.0).sum(axis=(0, 2))
    likelier += SIGN_COST * (moved & (turned < 0.0)).sum(axis=1)
    best = int(np.argmax(np.where(possible, likelier, -np.inf)))
    if not (possible[best] and likelier[best] > EXCHANGED):
        return _ELEVATIONS if (turned * change)[1] - (turned * change)[4] > BEYOND_SCAPULA_DEG else None
    columns = np.flatnonzero(moved[best])
    return Exchanged(tuple(ANGLES[k] for k in _ORDERS[best, columns]), tuple(ANGLES[k] for k in columns))


_ORDERS = np.array(
    [
        order
        for three in list(permutations(range(3)))[1:]
        for order in ((*three, 3, 4, 5), (0, 1, 2, *(3 + k for k in three)))
    ]
)
"""Orders of the columns with an exchange within one bone."""


def _squares(rest: Float[np.ndarray, "*orders 6"], change: Float[np.ndarray, "*orders 6"]) -> np.ndarray:
    """Compute squared deviations, in SD, from people's angles at rest and changes; NaN without information."""
    of_rest = np.where(_REST == 0.0, np.nan, (rest - _REST) / _REST_SD)
    of_change = np.where(_CHANGE == 0.0, np.nan, (change - _CHANGE) / _CHANGE_SD)
    return np.stack([of_rest, of_change]) ** 2


def runs_backward(found: RestAndChange) -> bool:
    """Check whether every angle goes the other way than in people while none has another sign at rest.

    The elevation is then measured from overhead, or belongs to another motion.
    """
    rest, change = found.rest, found.change
    known = np.isfinite(change) & (np.abs(_CHANGE) > _CHANGE_SD)
    at_rest = np.isfinite(rest) & (_REST != 0.0)
    backward = known.sum() >= _FEWEST_BACKWARD and (change * _CHANGE < 0.0)[known].all()
    return bool(backward and (rest * _REST > 0.0)[at_rest].all())


BACKWARD = "All angles go the other way: is humerus_elevation_deg measured from overhead? It is 0 with the arm hanging"

_FEWEST_BACKWARD = 3
"""Minimum number of angles that change: with ISB's beta, two go the other way too."""


def wrong_signs(found: RestAndChange) -> list[WrongSign]:
    """Find the angles of one subject that likely have the other sign."""
    rest, change = found.rest, found.change
    by_rest, by_change = 2.0 * rest * _REST / _REST_SD**2, 2.0 * change * _CHANGE / _CHANGE_SD**2
    half = (np.isnan(by_rest) != np.isnan(by_change)) & (_REST != 0.0) & (_CHANGE != 0.0)
    log_odds = np.nan_to_num(by_rest) + np.nan_to_num(by_change)
    wrong = np.flatnonzero(log_odds < LEAST_LOG_ODDS * np.where(half, 2.0, 1.0))
    far = (_REST != 0.0) & (np.abs(-rest - _REST) > FAR_SD * _REST_SD)
    return [
        WrongSign(name, _said(name, USUAL[name], rest[k], change[k]), float(log_odds[k]), bool(far[k]))
        for k, name in ((k, ANGLES[k]) for k in wrong)
    ]


TURNED_LOG_ODDS = 3.0
"""Log odds, 20 to 1, for the sign in one motion and against it in another. Measured motions have 0 and more."""


def turned_in_one_motion(found: RestAndChange) -> tuple[str, str] | None:
    """Find an angle with its sign in one large motion and the other sign in another; each motion begins at rest."""
    by_rest, by_change = 2.0 * found.starts * _REST / _REST_SD**2, 2.0 * found.of_motions * _CHANGE / _CHANGE_SD**2
    log_odds = np.where(found.large, np.nan_to_num(by_rest) + np.nan_to_num(by_change), 0.0)
    least, best = log_odds.argmin(axis=0), log_odds.max(axis=0)
    turned = np.flatnonzero((log_odds.min(axis=0) < -TURNED_LOG_ODDS) & (best > TURNED_LOG_ODDS))
    if not len(turned):
        return None
    where = [(ANGLES[k], found.motions[least[k]]) for k in turned]
    said = [f"{angle}_deg has another sign in {motion!r} than in the other motions" for angle, motion in where]
    return "; ".join(said), "Is that motion of the other side, or are signs turned round in it (docs/frames.md)?"


HELD_ARM_DEG = 20.0
"""Maximum range of elevation in degrees of a motion, such as horizontal flexion or axial rotation of the arm, in which
no rhythm turns the scapula."""

LEAST_PROTRACTION_DEG2, BACKWARD_SLOPE = 60.0, -0.4
"""Minimum sum of squares of clavicle_y about its mean in such motions, which noise of 1.5 degrees in 20 postures does
not reach; and slope of scapula_y over clavicle_y below which the scapula runs backward. Measured slopes: 0.9 to 1.8
above this sum, 0.1 to 1.3 below it."""


def protraction_runs_backward(motions: Motions) -> tuple[str, str] | None:
    """Find a scapula that turns inward while the clavicle carries it forward, round the thorax, and the arm is held."""
    squares = products = 0.0
    for motion in dict.fromkeys(motions.motion.tolist()):
        rows = motions.motion == motion
        x, y, elevation = motions.angles_deg[rows, 0], motions.angles_deg[rows, 3], motions.humerus_elevation_deg[rows]
        known = np.isfinite(x + y + elevation)
        if known.any() and np.ptp(elevation[known]) <= HELD_ARM_DEG:
            x = x[known] - x[known].mean()
            squares, products = squares + float(x @ x), products + float(x @ y[known])
    if squares < LEAST_PROTRACTION_DEG2 or products > BACKWARD_SLOPE * squares:
        return None
    slope = f"{products / squares:.1f} degrees a degree of clavicle_y_deg"
    remedy = "In people both grow: is scapula_y_deg 90 degrees minus the angle, or its sign another (docs/frames.md)?"
    return f"scapula_y_deg changes by {slope} while the arm is held", remedy


def _medians(values: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "6"]:
    """Compute the median of the known values of each angle; NaN if there are none."""
    count = np.isfinite(values).sum(axis=0)
    if not len(values):
        return np.full(values.shape[1], np.nan)
    ordered, column = np.sort(values, axis=0), np.arange(values.shape[1])  # NaN comes last
    low, high = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, len(values) - 1)
    return np.where(count > 0, (ordered[low, column] + ordered[high, column]) / 2.0, np.nan)


def _lowest(elevation_deg: Float[np.ndarray, " n"]) -> float:
    known = elevation_deg[np.isfinite(elevation_deg)]
    return float(known.min()) if len(known) else np.nan


def _lines(
    motions: Motions,
) -> tuple[Float[np.ndarray, "motions 6"], Float[np.ndarray, "motions 6"], Bool[np.ndarray, "motions 6"]]:
    """Fit the least-squares lines of ``RestAndChange``."""
    every: list[tuple[np.ndarray, ...]] = []
    for motion in dict.fromkeys(motions.motion.tolist()):
        rows = motions.motion == motion
        x, y = np.broadcast_to(motions.humerus_elevation_deg[rows, None], (rows.sum(), 6)), motions.angles_deg[rows]
        known = np.isfinite(x + y)
        x, y, count = np.where(known, x, 0.0), np.where(known, y, 0.0), np.maximum(known.sum(axis=0), 1)
        lowest, highest = np.where(known, x, np.inf).min(axis=0), np.where(known, x, -np.inf).max(axis=0)
        large, middle = highest - lowest >= LARGE_MOTION_DEG, x.sum(axis=0) / count
        away = np.where(known, x - middle, 0.0)
        slope = (away * y).sum(axis=0) / np.where(large, (away * away).sum(axis=0), 1.0)
        start = y.sum(axis=0) / count + slope * np.where(large, lowest - middle, 0.0)
        every.append((LARGE_MOTION_DEG * slope, np.where(lowest <= LOW_DEG, start, np.nan), large))
    changes, starts, large = zip(*every, strict=True)
    return np.stack(changes), np.stack(starts), np.stack(large)


def _said(angle: str, usual: Usual, rest: float, change: float) -> str:
    words = []
    if usual.rest and np.isfinite(rest):
        words.append(f"is {rest:.0f} with the arm low (people: {usual.rest:.0f} +- {usual.rest_sd:.0f})")
    if usual.change and np.isfinite(change):
        goes = "rises" if change > 0.0 else "falls"
        words.append(
            f"{goes} by {abs(change):.0f} degrees over 60 degrees of elevation (people: {usual.change:.0f} +- "
            f"{usual.change_sd:.0f})"
        )
    return f"{angle}_deg ({ANGLE_NAMES[angle]}) {' and '.join(words)}"


_MIRRORED = "If it is a right one, protraction has the other sign (docs/frames.md)"


def likely_convention(found: list[WrongSign]) -> str:
    """Write which convention the angles look like, and what to do."""
    angles = [one.angle for one in found]
    if far := [f"{one.angle}_deg" for one in found if one.far]:
        return (
            f"With the other sign {' and '.join(far)} is no person's either: check its frame and zero (docs/frames.md)"
        )
    if {"clavicle_y", "scapula_y"} <= set(angles):
        return "It looks like a left shoulder: say so (--side left, or left in the column side). " + _MIRRORED
    names = " and ".join(f"{angle}_deg" for angle in angles)
    turn = f"turn the sign of {names} round (docs/frames.md), or check which angle it is"
    isb = [angle for angle in angles if angle.endswith("_z")]
    if isb == angles:
        return f"It looks like ISB's beta: z = -beta; {turn}"
    if isb:
        return f"z looks like ISB's beta (z = -beta); {turn}"
    weak = angles == ["scapula_x"] and found[0].log_odds > SURE_LOG_ODDS
    return turn[0].upper() + turn[1:] + (". A scapula that hardly tips looks alike" if weak else "")
