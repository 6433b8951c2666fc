"""Columns of a motion file for postures with landmarks that clusters carried, or with an estimated GH."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from motions.landmarks.clusters.carried import CarriedTrial
from motions.landmarks.estimated_landmarks import GlenohumeralOffset
from motions.landmarks.resampling import resample
from motions.motion_csv.columns import HUMERUS_PLACED, SCAPULA_FROM
from motions.table import Motions


def residual_column(segment: str) -> str:
    """Return the name of the extra column with the residual of a cluster's rigid fit (root mean square, mm)."""
    return f"{segment}_cluster_residual_mm"


def with_cluster(part: Motions, trial: CarriedTrial, rows: Int[np.ndarray, " frames"], sampled: bool) -> Motions:
    """Add the columns of a trial with clusters: calibration of the scapula, and residual of each rigid fit.

    ``rows``: frames of the trial from which the postures were taken or sampled.
    """
    extra = part.extra.copy()
    if "scapula" in trial.calibration.clusters:
        extra[SCAPULA_FROM] = [trial.calibration.said] * len(part.posture)
    for segment, residual in trial.residuals_mm.items():
        mine = residual[rows]
        known = (
            _sampled(trial.elevation_deg[rows], mine, part.humerus_elevation_deg) if sampled else mine[part.posture - 1]
        )
        extra[residual_column(segment)] = ["" if np.isnan(mm) else f"{mm:.3g}" for mm in known]
    return replace(part, extra=extra)


def with_placed_gh(part: Motions, offset: GlenohumeralOffset) -> Motions:
    """Mark postures with an estimated GH, and leave out its position, which nobody measured."""
    extra = part.extra.copy()
    extra[HUMERUS_PLACED] = [f"GH from AC by a stated offset +- {offset.uncertainty_mm:g} mm"] * len(part.posture)
    landmarks_mm = {name: place for name, place in part.landmarks_mm.items() if name != "GH"}
    return replace(part, extra=extra, landmarks_mm=landmarks_mm)


def _sampled(
    elevation_deg: Float[np.ndarray, " frames"],
    values: Float[np.ndarray, " frames"],
    at_deg: Float[np.ndarray, " postures"],
) -> Float[np.ndarray, " postures"]:
    """Compute the values on the local line at each elevation; NaN where too few frames are near."""
    found = resample(elevation_deg, values[:, None], at_deg)
    by_elevation = dict(zip(found.at_deg.tolist(), found.values[:, 0].tolist(), strict=True))
    return np.array([by_elevation.get(at, np.nan) for at in at_deg.tolist()])
