"""The adapted parameters: the numbers of a girdle that an adaptation changes, with their bounds, starts and SDs.

The thesis adapts six parameters (6.2.6): the y and z of the ellipsoid's centre (M_x is 0: A4), the semi-axes and the
conoid length. To adapt another component of the ellipsoid, add it to ``ADAPTED_PARAMETERS`` before the conoid length:
solvers, tables and files follow. For other numbers of a girdle no derivatives are written out (``models.derivatives``).

Each parameter has two widths, because they answer two questions:

- ``half_width_mm``: how far may an adaptation go? Farther than the SDs of ten subjects (Table 6.5), but not so far that
  the parameter runs away.
- ``person_sd_mm``: how far does a person's thorax differ from the parameter set's? At most by the SD of ten subjects
  (Table 6.5), which includes the noise of their measurement. Simulated people differ by this SD, and the uncertainty of
  adapted parameters includes it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from motions.arrays import Array

_CENTRE, _SEMI_AXES, _CONOID = "centre_mm", "semi_axes_mm", "conoid_length_mm"


@dataclass(frozen=True)
class AdaptedParameter:
    """One number of ``models.girdle.Girdle`` that an adaptation changes, in mm."""

    name: str
    field: str
    """Name of the field of ``Girdle``."""
    component: int
    """Index in the field's vector: 0 for x, 1 for y, 2 for z; 0 for a length."""
    half_width_mm: float
    """Default half width of the bounds about the set's own value, for files that give none."""
    start_offset_mm: float
    """Offset of the second and third start of an adaptation, above and below the geometric fit."""
    person_sd_mm: float
    """SD between people, as far as it is known: Table 6.5 gives 8-31, 6-7, 2-3, 13-24, 15-17 and 1-2 mm."""
    beside_bones_sd_mm: float | None = None
    """SD between people for an adaptation with own bones; by default half of ``person_sd_mm``. Assumption: the SDs of
    Table 6.5 include what the adapted ellipsoids do to compensate for the bones."""

    @property
    def key(self) -> str:
        """Name with the unit, as in files."""
        return f"{self.name}_mm"

    @property
    def of_ellipsoid(self) -> bool:
        """True where A1 and A2 depend on the parameter; A3 depends on the conoid length alone."""
        return self.field != _CONOID

    @property
    def is_length(self) -> bool:
        """True where the parameter must stay positive."""
        return self.field != _CENTRE


ADAPTED_PARAMETERS = (
    AdaptedParameter("M_y", _CENTRE, 1, 100.0, 60.0, 20.0, 10.0),
    AdaptedParameter("M_z", _CENTRE, 2, 30.0, 0.0, 6.0, 5.0),
    AdaptedParameter("A_x", _SEMI_AXES, 0, 30.0, 0.0, 3.0, 4.0),
    AdaptedParameter("A_y", _SEMI_AXES, 1, 100.0, 60.0, 20.0, 12.0),
    AdaptedParameter("A_z", _SEMI_AXES, 2, 30.0, 0.0, 8.0, 4.0),
    AdaptedParameter("conoid_length", _CONOID, 0, 8.0, 0.0, 2.0, 1.5),
)

ADAPTED = tuple(parameter.name for parameter in ADAPTED_PARAMETERS)
"""Names of the adapted parameters, in the order of every vector theta."""

ELLIPSOID = tuple(parameter for parameter in ADAPTED_PARAMETERS if parameter.of_ellipsoid)
"""Parameters of the ellipsoid, which A1, A2 and D depend on: the first entries of theta."""

HALF_WIDTHS_MM = {parameter.key: parameter.half_width_mm for parameter in ADAPTED_PARAMETERS}

STARTS_MM = np.outer((0.0, 1.0, -1.0), [parameter.start_offset_mm for parameter in ADAPTED_PARAMETERS]) + 0.0
"""Offsets of the starts from the geometric fit, mm. E has many local minima (thesis 6.2.6). Minima below the one that
the geometric fit leads to were found from a thorax with a higher centre and a longer A_y, or a lower centre and a
shorter A_y. Compared with these starts, 40 random starts found a lower minimum in none of 8 measured shoulders with
five sets, and 12 random starts in 4 of 1800 simulated adaptations, by up to 1 %. Starts with M_y and A_y in
opposite directions, or with a deeper thorax, found nothing lower."""

PERSON_SD_MM = np.array([parameter.person_sd_mm for parameter in ADAPTED_PARAMETERS])

if ADAPTED_PARAMETERS[: len(ELLIPSOID)] != ELLIPSOID or len(ADAPTED_PARAMETERS) - len(ELLIPSOID) != 1:
    raise ValueError("ADAPTED_PARAMETERS: components of the ellipsoid first, the conoid's length last")

Theta = Sequence[Array] | Float[Array, " adapted *batch"]
"""One value per entry of ``ADAPTED_PARAMETERS``, mm."""


def adapted_components(girdle: Any) -> list[Array]:
    """Return the adapted parameters of a girdle, one array per parameter, mm."""
    return [
        getattr(girdle, one.field) if one.field == _CONOID else getattr(girdle, one.field)[one.component]
        for one in ADAPTED_PARAMETERS
    ]


def ellipsoid_components(girdle: Any, theta: Theta) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
    """Return the components of the centre and of the semi-axes of a girdle's ellipsoid with theta inserted, mm."""
    found = {_CENTRE: list(girdle.centre_mm), _SEMI_AXES: list(girdle.semi_axes_mm)}
    for one, value in zip(ELLIPSOID, theta, strict=False):
        found[one.field][one.component] = value
    (M_x, M_y, M_z), (A_x, A_y, A_z) = found.values()
    return (M_x, M_y, M_z), (A_x, A_y, A_z)


def conoid_length(theta: Theta) -> Array:
    """Return the conoid length of theta, mm."""
    return theta[len(ELLIPSOID)]
