"""The ellipsoid of a person's thorax, from points on it (thesis 4.3.5 and 6.2.6, Eq. 6.3-6.4).

    min D = mean d_k^2   over M_y, M_z, A_x, A_y, A_z, with M_x = 0,

where d_k is the distance of point k to the surface. In the thesis, this closest ellipsoid was the best starting point
of an adaptation. If the points cover only a patch, M_y and A_y trade off (4.3.6); their correlation and SDs say how
well the patch determines them.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from models.adapted_parameters import ADAPTED, ELLIPSOID, PERSON_SD_MM, ellipsoid_components
from models.ellipsoid import signed_distance_mm
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
from models.person.least_squares import Fit, Points, fitted, minimised
from models.sets.set_geometry import FEWEST_POINTS, SHORTEST_MM
from motions.arrays import Array, xp

_M_Y, _A_Y = ADAPTED.index("M_y"), ADAPTED.index("A_y")


_ON_THE_POINTS_MM2 = 1e-18
"""Limit of D below which an ellipsoid passes through its points, 1e-9 mm off by rounding in their file, and needs no
fit."""


def thorax_distance_mm2(
    girdle: Girdle,
    points_mm: Float[Array, " 3 points *batch"],
    point_weights: Float[Array, " points *batch"],
    levels_mm: Float[Array, " points *batch"] | float = 0.0,
) -> Float[Array, " *batch"]:
    """Compute D, the mean squared distance of the thorax points to the ellipsoid, mm^2.

    ``point_weights`` sum to 1 over the points: 1/n each, 0 for padding. ``levels_mm``: target distances of the points
    to the surface, if not 0.
    """
    spread = girdle.over_postures()
    distance = signed_distance_mm(points_mm, spread.centre_mm, spread.semi_axes_mm)
    return xp.sum(point_weights * (distance - levels_mm) ** 2, axis=0)


def fitted_girdle(girdle: Girdle, points_mm: Points) -> Girdle:
    """Fit a girdle by :func:`geometric_fit`, as numpy; if its ellipsoid lies on the points, return it unchanged."""
    point_weights = np.full(points_mm.shape[1], 1.0 / points_mm.shape[1])
    if thorax_distance_mm2(jax.tree.map(np.asarray, girdle), points_mm, point_weights) <= _ON_THE_POINTS_MM2:
        return girdle
    return jax.tree.map(np.asarray, jitted_geometric_fit(girdle, jnp.asarray(points_mm)))


def geometric_fit(girdle: Girdle, points_mm: Float[Array, " 3 points"]) -> Girdle:
    """Fit the girdle's ellipsoid to its thorax points by min D (thesis 6.2.6, Table 6.6).

    The ellipsoid stays unchanged where no ellipsoid minimises D. The points of the shipped sets lie on the published
    ellipsoid, so the fit returns this ellipsoid.
    """
    start, weights = girdle.adapted_mm[: len(ELLIPSOID)], jnp.ones(points_mm.shape[1])
    values, found = minimised(_distances, start, points_mm, weights, (girdle,))
    return girdle.with_adapted(xp.append(xp.where(found, values, start), girdle.conoid_length_mm))


jitted_geometric_fit = jax.jit(geometric_fit)


@dataclass(frozen=True)
class ThoraxFit:
    """The fitted ellipsoid, thorax frame, mm."""

    centre_mm: Float[np.ndarray, "3"]
    semi_axes_mm: Float[np.ndarray, "3"]
    fit: Fit
    """Fit of the parameters in the order of ``ELLIPSOID``."""

    @property
    def correlation(self) -> float:
        """Correlation of M_y and A_y."""
        return self.fit.correlation(_M_Y, _A_Y)

    @property
    def loose(self) -> tuple[str, ...]:
        """Parameters whose SD from the fit exceeds their SD between people, so the points do not determine them."""
        names = ADAPTED[: len(ELLIPSOID)]
        return tuple(n for n, sd, known in zip(names, self.fit.sd, PERSON_SD_MM, strict=False) if sd > known)


def fit_thorax(points_mm: Points, start: Girdle) -> ThoraxFit:
    """Fit the ellipsoid to points in the thorax frame, starting from the ellipsoid of a generic girdle.

    ValueError for fewer than ``FEWEST_POINTS`` points, or where no ellipsoid minimises D: on a flat patch the axes grow
    without limit.
    """
    if points_mm.shape[1] < FEWEST_POINTS:
        raise ValueError(f"{points_mm.shape[1]} points on the thorax, and the ellipsoid needs {FEWEST_POINTS}")
    theta = np.asarray(start.adapted_mm)[: len(ELLIPSOID)]
    start = jax.tree.map(np.asarray, start)
    fit = fitted(_distances, points_mm, theta, start)
    centre, semi_axes = (np.array(part, float) for part in ellipsoid_components(start, list(fit.values)))
    semi_axes = np.abs(semi_axes)
    if not fit.converged or semi_axes.min() < SHORTEST_MM:
        raise ValueError("no ellipsoid is closest to the points on the thorax: they cover too small or flat a patch")
    return ThoraxFit(centre, semi_axes, fit)


def thorax_sd_mm(one: ParameterSet) -> Float[np.ndarray, " adapted"]:
    """Return the SDs of a person's adapted parameters about the set's.

    For the ellipsoid the SD is that between people, or the SD of the fit if the set states that its ellipsoid was
    fitted to the person's own points and the SD of the fit is smaller. For the conoid length it is that between people.
    """
    sd = PERSON_SD_MM.copy()
    for k, parameter in enumerate(ELLIPSOID):
        key = f"thorax.{parameter.field}"
        stated = one.range_mm(key) if one.is_measured(key) else None
        sd[k] = sd[k] if stated is None else min(sd[k], stated)
    return sd


def has_own_thorax(one: ParameterSet) -> bool:
    """Check whether the ellipsoid of a person's set was fitted to this person's own points."""
    return all(one.is_measured(f"thorax.{parameter.field}") for parameter in ELLIPSOID)


def _distances(theta, points_mm, girdle: Girdle):
    centre, semi_axes = ellipsoid_components(girdle, theta)
    return signed_distance_mm(points_mm, jnp.stack(centre)[:, None], jnp.stack(semi_axes)[:, None])
