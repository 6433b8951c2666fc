"""Location of the gap after adaptation: by angle, motion and elevation, and in the constraints."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.location.constraint_spread import ConstraintSpread, constraint_spread
from adapt.diagnosis.location.gap_location import (
    AngleGaps,
    Cell,
    ConstraintResidual,
    Profile,
    cells,
    constraint_residuals_mm,
    profile,
)
from adapt.diagnosis.location.observations import Observed
from models.effects import AnyGirdle


@dataclass(frozen=True)
class Where:
    """Location of the gap of the adapted model."""

    cells: list[Cell]
    profile: Profile
    constraints: list[ConstraintResidual]
    constraint_spread: list[ConstraintSpread]


def locate(
    data: Observed,
    simulated: Float[np.ndarray, "6 postures subjects"],
    noise_deg2: Float[np.ndarray, "6 postures subjects"],
    chains: tuple[AnyGirdle, AnyGirdle],
    noise_deg: float,
) -> Where:
    """Locate the gap between measured and simulated angles (rad).

    ``noise_deg2``: expected squared difference from noise alone. ``chains``: of all subjects, adapted, and adapted with
    the causes, (component, postures, subjects).
    """
    gaps, (adapted, with_causes) = AngleGaps(data, simulated, noise_deg2), chains
    return Where(
        cells=cells(gaps),
        profile=profile(gaps),
        constraints=constraint_residuals_mm(data, np.asarray(adapted.residuals_mm(data.angles))),
        constraint_spread=constraint_spread(data, adapted, with_causes, noise_deg),
    )
