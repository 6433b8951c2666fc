"""Moving trials with the landmarks that their clusters carry."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from motions.errors import InputError, warn_input
from motions.landmarks.clusters.calibration import Calibration, carried_by, cluster_markers_mm, elevation_deg
from motions.landmarks.clusters.rigid_fit import Pose, fit_rigid
from motions.landmarks.mapping import Mapping
from motions.landmarks.markers import NEEDED, Markers, check_size, landmarks_there_mm, millimetres

LARGEST_RESIDUAL_MM = 10.0
"""Largest residual of a rigid fit, root mean square. A plate keeps its shape to a millimetre, markers on skin to a few.
A larger residual means a swapped or lost marker (assumed), and the frame becomes a gap."""

FAR_BEYOND_DEG = 20.0
"""Distance from the calibrated elevations beyond which a warning names the extrapolation."""

_SAME_DEG = 1e-10
_MOST_ROUNDS = 50
"""Maximum number of iterations until the elevation agrees with the place of GH, which depends on the elevation. Each
iteration reduces the difference tenfold."""


@dataclass(frozen=True, eq=False)
class CarriedTrial:
    """Measured and carried landmarks of each frame, mm, in the file's own frame; NaN is a gap."""

    lab_mm: dict[str, Float[np.ndarray, "3 frames"]]
    residuals_mm: dict[str, Float[np.ndarray, " frames"]]
    """Residuals of the rigid fit of each cluster, by segment."""
    elevation_deg: Float[np.ndarray, " frames"]
    calibration: Calibration


def carry(markers: Markers, mapping: Mapping, calibration: Calibration) -> CarriedTrial:
    """Carry the calibrated landmarks into a trial; carried landmarks replace markers of the same name.

    InputError where a cluster is in no frame of the trial, or where a needed landmark is neither there nor carried.
    InputWarning where frames are left out, or where the arm goes far beyond the calibrated elevations.
    """
    factor = millimetres(markers, mapping)
    lab_mm = landmarks_there_mm(markers, mapping, factor)
    poses, residuals = {}, {}
    for segment in calibration.clusters:
        poses[segment], residuals[segment] = _pose(markers, mapping, calibration, segment, factor)
    count = markers.positions.shape[2]
    for segment in ("thorax", "humerus"):
        if segment in poses:
            lab_mm |= _in_lab(calibration, segment, poses[segment], np.full(count, np.nan))
    elevation = np.full(count, np.nan)
    if "scapula" in poses:
        lab_mm, elevation = _with_scapula(markers.file, lab_mm, mapping, calibration, poses["scapula"])
    absent = [name for name in NEEDED if name not in lab_mm] + ["AC"] * (not {"AC", "AA"} & lab_mm.keys())
    if absent:
        cause = f"landmarks {', '.join(absent)} are neither in the trial nor carried by a cluster"
        remedy = "Palpate them in a static trial (--static), with a cluster under [clusters] that carries them"
        raise InputError(markers.file, None, cause, remedy)
    check_size(markers.file, lab_mm, factor)
    known = elevation_deg(lab_mm)
    return CarriedTrial(lab_mm, residuals, elevation if known is None else known, calibration)


def _pose(
    markers: Markers, mapping: Mapping, calibration: Calibration, segment: str, factor: float
) -> tuple[Pose, Float[np.ndarray, " frames"]]:
    """Compute the pose of a cluster in each frame, and the residual of its fit."""
    cluster = calibration.clusters[segment]
    places = cluster_markers_mm(markers, mapping, segment, factor)
    nothing = np.full((3, markers.positions.shape[2]), np.nan)
    fit = fit_rigid(cluster.shape_mm, np.stack([places.get(name, nothing) for name in cluster.names]))
    if np.isnan(fit.residual_mm).all():
        absent = [name for name in cluster.names if name not in places]
        cause = f"cluster {segment} is in no frame: " + (
            f"there is no marker {', '.join(absent)}" if absent else "gaps"
        )
        raise InputError(markers.file, None, cause, "Name its markers under [clusters] in the mapping file (--map)")
    wrong = fit.residual_mm > LARGEST_RESIDUAL_MM
    if wrong.any():
        frames = np.flatnonzero(wrong) + 1
        cause = f"cluster {segment} has not its shape in {len(frames)} frames, {frames[0]} to {frames[-1]}: it is "
        cause += f"{np.nanmax(fit.residual_mm):.0f} mm off (rms); they are left out"
        warn_input(InputError(markers.file, None, cause, "Look for markers of the cluster that are swapped or lost"))
    pose = Pose(*(np.where(wrong, np.nan, part) for part in fit.pose))
    return pose, np.where(wrong, np.nan, fit.residual_mm)


def _in_lab(calibration: Calibration, segment: str, pose: Pose, elevation: np.ndarray) -> dict[str, np.ndarray]:
    """Compute the landmarks that a cluster carries, in the frame of the file."""
    body = calibration.bodies[segment]
    in_lab = pose.after(body.in_cluster(elevation))
    return {name: in_lab.carry(place) for name, place in body.landmarks_mm.items()}


def _with_scapula(
    file: str, lab_mm: dict[str, np.ndarray], mapping: Mapping, calibration: Calibration, pose: Pose
) -> tuple[dict[str, np.ndarray], Float[np.ndarray, " frames"]]:
    """Add the landmarks of the scapula; return also the elevation of the arm over which they are interpolated."""
    nodes = calibration.bodies["scapula"].elevations_deg
    elevation = np.full(pose.t.shape[1], nodes[0])
    found = lab_mm | _in_lab(calibration, "scapula", pose, elevation)
    if len(nodes) < 2:
        return found, elevation
    for _ in range(_MOST_ROUNDS):
        now = elevation_deg(found)
        if now is None:
            cause = "the scapula was calibrated in several postures, but the arm has no elevation here: no GH, EM or EL"
            raise InputError(file, None, cause, "Measure them, or give a single static trial (--static)")
        found = lab_mm | _in_lab(calibration, "scapula", pose, now)
        moved, elevation = np.abs(now - elevation), now
        if "GH" not in carried_by("scapula", mapping) or not (moved > _SAME_DEG).any():
            break
    beyond = np.maximum(nodes[0] - elevation, elevation - nodes[-1])
    if (beyond > FAR_BEYOND_DEG).any():
        calibrated = f"the static postures ({nodes[0]:.0f} to {nodes[-1]:.0f})"
        cause = f"the arm goes {np.nanmax(beyond):.0f} degrees beyond {calibrated}"
        warn_input(InputError(file, None, cause, "The scapula is extrapolated there: add a static trial at its end"))
    return found, elevation
