"""The adapted parameters: what an adaptation changes of a girdle, each with its bounds, starts and SD.

The thesis adapts six (6.2.6): the ellipsoid's centre but for M_x (which is 0: A4), its semi-axes and the length of the
conoid. To adapt another component of the ellipsoid, add it to ``ADAPTED_PARAMETERS``, before the conoid's length: the
solvers, tables and files follow. Other numbers of a girdle have no derivatives by hand (``models.derivatives``).

Two widths of each parameter stand side by side because they answer two questions:

- ``half_width_mm``: how far may an adaptation go? Beyond the SDs of ten subjects (Table 6.5), short of a runaway.
- ``person_sd_mm``: how far is a person's thorax from the parameter set's? At most the SD of ten subjects (Table 6.5),
  which holds the noise of their measurement too. Simulated people differ by it, and it enters their uncertainty.
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
    """Of the girdle."""
    component: int
    """Of the field's vector: 0 for x, 1 for y, 2 for z; 0 for a length."""
    half_width_mm: float
    """How far it may go from the set's own value, where the file does not say."""
    start_offset_mm: float
    """By how much the second and third start of an adaptation lie above and below the geometric fit."""
    person_sd_mm: float
    """SD between people, as far as it is known: Table 6.5 has 8-31, 6-7, 2-3, 13-24, 15-17 and 1-2 mm."""
    beside_bones_sd_mm: float | None = None
    """The same where bones of the person's own are adapted too; by default half of it. Assumed: the SDs of Table 6.5
    hold what adapted ellipsoids pay for the bones."""

    @property
    def key(self) -> str:
        """Its name with the unit, as files have it."""
        return f"{self.name}_mm"

    @property
    def of_ellipsoid(self) -> bool:
        """Whether A1 and A2 depend on it; A3 depends on the conoid's length alone."""
        return self.field != _CONOID

    @property
    def is_length(self) -> bool:
        """Whether it must stay positive."""
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
"""Their names, in the order of every vector theta."""

ELLIPSOID = tuple(parameter for parameter in ADAPTED_PARAMETERS if parameter.of_ellipsoid)
"""Those that A1, A2 and D depend on: the first ones of theta."""

HALF_WIDTHS_MM = {parameter.key: parameter.half_width_mm for parameter in ADAPTED_PARAMETERS}

STARTS_MM = np.outer((0.0, 1.0, -1.0), [parameter.start_offset_mm for parameter in ADAPTED_PARAMETERS]) + 0.0
"""Offsets of the starts from the geometric fit. E has many local minima (thesis 6.2.6). Those that lay lower than where
the geometric fit leads were found from thoraxes whose centre is higher and which are longer, or lower and shorter. 40
random starts of each found lower ones than these in none of 8 measured shoulders with five sets, and 12 in 4 of 1800
simulated adaptations, by up to 1 %; starts with M_y against A_y, or deeper, added nothing."""

PERSON_SD_MM = np.array([parameter.person_sd_mm for parameter in ADAPTED_PARAMETERS])

if ADAPTED_PARAMETERS[: len(ELLIPSOID)] != ELLIPSOID or len(ADAPTED_PARAMETERS) - len(ELLIPSOID) != 1:
    raise ValueError("ADAPTED_PARAMETERS: components of the ellipsoid first, the conoid's length last")

Theta = Sequence[Array] | Float[Array, " adapted *batch"]
"""One value of each of ``ADAPTED_PARAMETERS``, mm."""


def adapted_components(girdle: Any) -> list[Array]:
    """Take the adapted parameters out of a girdle, one array each, mm."""
    return [
        getattr(girdle, one.field) if one.field == _CONOID else getattr(girdle, one.field)[one.component]
        for one in ADAPTED_PARAMETERS
    ]


def ellipsoid_components(girdle: Any, theta: Theta) -> tuple[tuple[Array, Array, Array], tuple[Array, Array, Array]]:
    """Put theta into a girdle's ellipsoid: three components each of its centre and of its semi-axes, mm."""
    found = {_CENTRE: list(girdle.centre_mm), _SEMI_AXES: list(girdle.semi_axes_mm)}
    for one, value in zip(ELLIPSOID, theta, strict=False):
        found[one.field][one.component] = value
    (M_x, M_y, M_z), (A_x, A_y, A_z) = found.values()
    return (M_x, M_y, M_z), (A_x, A_y, A_z)


def conoid_length(theta: Theta) -> Array:
    """Take the length of the conoid out of theta, mm."""
    return theta[len(ELLIPSOID)]
