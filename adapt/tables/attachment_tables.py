"""Tables of `girdle transfer`: carried points, and their distances from measured points and from the bone."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from jaxtyping import Float

from models.person.transfer.attachment_types import attachment_type
from models.person.transfer.contour_distances import (
    LINE,
    PLANE,
    between_contours,
    between_means_mm,
    to_line,
    to_plane,
    to_surface,
)
from models.person.transfer.mesh import Mesh

Points = Float[np.ndarray, "3 points"]

NO_TYPE = "none"
"""Type of distances for which Table 5.3 has no type."""

DISTANCES = ("attachment", "shape", "points", "surface_mm", "surface_sd_mm")
MEASURED = ("measured_surface_mm", "measured_surface_sd_mm", "least_mm", "mean_mm", "most_mm", "type")
LINES, PLANES = ("md_mm", "md_sd_mm", "mind_mm", "maxd_mm"), ("mdp_mm", "mdp_sd_mm", "dmp_mm")
COLUMNS = (*DISTANCES, *MEASURED, *LINES, *PLANES)
"""Columns of ``distances.csv``. surface: mean and SD of the distance of the carried points to the target's surface
(Appendix C); measured_surface: the same of the measured points. least, mean and most: distances between the
contours; type: their type (Table 5.3). md, mind and maxd: distances of the measured points to the carried line (Table
4.7); mdp: distance of the measured points to the carried plane; dmp: distance between the mean points (Table 4.6)."""


def points_table(carried: Mapping[str, Points], shapes: Mapping[str, str]) -> pd.DataFrame:
    """Tabulate ``attachments.csv``: attachment, shape, x_mm, y_mm, z_mm in the frame of the target."""
    rows = [(name, shapes[name], *point) for name, points in carried.items() for point in points.T.tolist()]
    return pd.DataFrame(rows, columns=["attachment", "shape", "x_mm", "y_mm", "z_mm"])


def distances_table(
    carried: Mapping[str, Points], shapes: Mapping[str, str], measured: Mapping[str, Points], mesh: Mesh | None
) -> pd.DataFrame:
    """Tabulate ``distances.csv``: one row per attachment, the columns ``COLUMNS``; unknown cells are empty."""
    rows = [_row(name, shapes[name], points, measured.get(name), mesh) for name, points in carried.items()]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _row(name: str, shape: str, points: Points, measured: Points | None, mesh: Mesh | None) -> dict[str, object]:
    row: dict[str, object] = {"attachment": name, "shape": shape, "points": points.shape[1]}
    if mesh is not None:
        row |= _surface("surface", points, mesh)
    if mesh is not None and measured is not None:
        row |= _surface("measured_surface", measured, mesh)
    if measured is None:
        return row
    apart = between_contours(points, measured, shape)
    kind = attachment_type(apart.least_mm, apart.mean_mm, apart.most_mm) or NO_TYPE
    row |= {"least_mm": apart.least_mm, "mean_mm": apart.mean_mm, "most_mm": apart.most_mm, "type": kind}
    if shape == LINE:
        off = to_line(measured, points)
        row |= {"md_mm": off.mean_mm, "md_sd_mm": off.sd_mm, "mind_mm": off.least_mm, "maxd_mm": off.most_mm}
    if shape == PLANE:
        mdp, sd = to_plane(measured, points)
        row |= {"mdp_mm": mdp, "mdp_sd_mm": sd, "dmp_mm": between_means_mm(measured, points)}
    return row


def _surface(name: str, points: Points, mesh: Mesh) -> dict[str, object]:
    off = to_surface(points, mesh)
    return {f"{name}_mm": off.mean_mm, f"{name}_sd_mm": off.sd_mm}
