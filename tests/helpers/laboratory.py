"""A simulated laboratory: a girdle with a known motion, and its landmarks as a capture system would write them."""

from dataclasses import dataclass

import ezc3d
import jax
import jax.numpy as jnp
import numpy as np
from numpy.random import Generator
from programs import few_runs
from scipy.spatial.transform import Rotation

from models import load_model
from models.girdle import Girdle, landmarks
from motions.rhythm import COEFFICIENTS, REST_DEG, girdle_angles_deg
from motions.rotations import DEG, rotation_from_cardan

RATE = 100.0
SECONDS_UP = 3.0
HIGHEST_DEG = 140.0

# These midline landmarks give the identity as the thorax frame, at the origin: the middle of IJ and C7 lies straight
# above that of PX and T8.
THORAX_MM = {
    "IJ": np.array([0.0, 0.0, 0.0]),
    "C7": np.array([0.0, 40.0, 120.0]),
    "PX": np.array([0.0, -170.0, -10.0]),
    "T8": np.array([0.0, -150.0, 130.0]),
}
GH_MM = np.array([-10.0, -45.0, -15.0])
"""Position of GH in the scapula frame."""
HUMERUS_MM, ELBOW_MM = 280.0, 35.0
"""Distance from GH to the middle of the elbow, and from there to an epicondyle."""
AA_MM = np.array([-8.0, -12.0, 32.0])
"""Position of AA in the scapula frame through AC: behind and below AC."""


@dataclass(frozen=True)
class Trial:
    """Simulated motion of a right shoulder: true angles, and landmarks in the thorax frame."""

    elevation_deg: np.ndarray
    angles_deg: np.ndarray
    """Shape (frames, 6)."""
    thorax_mm: dict[str, np.ndarray]
    """Shape (3, frames) each."""


def simulated_trial(elevation_deg: np.ndarray, plane_deg: float = 0.0, closed: bool = False) -> Trial:
    """Raise the arm of R2 by the published rhythm; where ``closed``, by angles near it that close the chain."""
    girdle = load_model("R2").girdle
    rest = np.repeat(REST_DEG[:, None], len(elevation_deg), axis=1)
    coefficients = np.repeat(COEFFICIENTS[:, :, None], len(elevation_deg), axis=2)
    angles = girdle_angles_deg(rest, np.full(len(elevation_deg), plane_deg), elevation_deg, coefficients) / float(DEG)
    return trial_of(girdle, on_constraints(girdle, angles) if closed else angles, elevation_deg, plane_deg)


def on_constraints(girdle: Girdle, angles: np.ndarray) -> np.ndarray:
    """Return angles (6, frames) near the given ones where A1-A3 hold, by Gauss-Newton steps q - G' (G G')^-1 g."""
    frames = girdle.repeated(angles.shape[1])
    q = jnp.asarray(angles)
    for _ in range(12):
        g, G = (np.moveaxis(np.asarray(x), -1, 0) for x in _linearised(frames, q))
        Gt = np.swapaxes(G, 1, 2)
        q = q - (Gt @ np.linalg.solve(G @ Gt, g[..., None]))[..., 0].T
    assert np.abs(np.asarray(_linearised(frames, q)[0])).max() < 1e-9
    return np.asarray(q)


@few_runs
def _linearised(girdle: Girdle, q):
    """Compute g and its derivatives by the six angles."""
    units = [jnp.broadcast_to(unit[:, None], q.shape) for unit in jnp.eye(6)]
    rows = [jax.jvp(girdle.residuals_mm, (q,), (unit,)) for unit in units]
    return rows[0][0], jnp.stack([row[1] for row in rows], axis=1)


def trial_of(girdle: Girdle, angles: np.ndarray, elevation_deg: np.ndarray, plane_deg: float) -> Trial:
    """Return the landmarks of a girdle at angles (6, frames) in radians, and of an arm."""
    at = landmarks(girdle.repeated(len(elevation_deg)), angles)
    R_scapula = rotation_from_cardan(angles[3:])
    AC = at.AC
    arm_deg = np.stack([np.full_like(elevation_deg, plane_deg), elevation_deg, np.full_like(elevation_deg, 20.0)])
    R_humerus = np.moveaxis(Rotation.from_euler("YZY", arm_deg.T, degrees=True).as_matrix(), 0, -1)
    GH = AC + np.einsum("ijn,j->in", R_scapula, GH_MM)
    elbow = GH - HUMERUS_MM * R_humerus[:, 1]
    thorax = {name: np.repeat(xyz[:, None], len(elevation_deg), axis=1) for name, xyz in THORAX_MM.items()}
    moving = {
        "SC": np.repeat(np.asarray(girdle.sc_mm)[:, None], len(elevation_deg), axis=1),
        "AC": AC,
        "AA": AC + np.einsum("ijn,j->in", R_scapula, AA_MM),
        "TS": np.asarray(at.TS),
        "AI": np.asarray(at.AI),
        "GH": GH,
        "EM": elbow - ELBOW_MM * R_humerus[:, 0],
        "EL": elbow + ELBOW_MM * R_humerus[:, 0],
    }
    return Trial(elevation_deg, np.asarray(angles).T * float(DEG), thorax | moving)


def up_and_down(highest_deg: float = HIGHEST_DEG, seconds_up: float = SECONDS_UP) -> np.ndarray:
    """Return elevations of an arm that is raised and lowered once, smoothly; one value per frame."""
    frames = int(2 * seconds_up * RATE)
    return highest_deg * 0.5 * (1.0 - np.cos(2.0 * np.pi * np.arange(frames) / (frames - 1)))


def in_laboratory(
    thorax_mm: dict[str, np.ndarray], rotation: np.ndarray, origin_mm: np.ndarray
) -> dict[str, np.ndarray]:
    """Transform landmarks to a laboratory frame; the columns of ``rotation`` are the axes of the thorax in it."""
    return {name: rotation @ xyz + origin_mm[:, None] for name, xyz in thorax_mm.items()}


def with_noise(lab: dict[str, np.ndarray], sd: float, generator: Generator) -> dict[str, np.ndarray]:
    return {name: xyz + sd * generator.standard_normal(xyz.shape) for name, xyz in lab.items()}


def with_gaps(lab: dict[str, np.ndarray], gaps: dict[str, slice]) -> dict[str, np.ndarray]:
    """Put NaN into some frames of some markers."""
    result = {name: xyz.copy() for name, xyz in lab.items()}
    for name, frames in gaps.items():
        result[name][:, frames] = np.nan
    return result


def write_c3d(path, lab: dict[str, np.ndarray], unit: str | None = "mm", names: list[str] | None = None) -> None:
    """Write the landmarks as a .c3d file, by ezc3d."""
    content = ezc3d.c3d()
    point = content["parameters"]["POINT"]
    point["RATE"]["value"] = [RATE]
    point["LABELS"]["value"] = names or list(lab)
    if unit is not None:
        point["UNITS"]["value"] = [unit]
    xyz = np.stack(list(lab.values()), axis=1)
    content["data"]["points"] = np.concatenate([xyz, np.ones((1, *xyz.shape[1:]))])
    content.write(str(path))


def trc_lines(lab: dict[str, np.ndarray], unit: str = "mm", frames_said: int | None = None) -> list[str]:
    """Return the landmarks as the lines of a .trc file; gaps are empty cells."""
    names, count = list(lab), next(iter(lab.values())).shape[1]
    said = count if frames_said is None else frames_said
    head = [
        "PathFileType\t4\t(X/Y/Z)\ttrial.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{RATE}\t{RATE}\t{said}\t{len(names)}\t{unit}\t{RATE}\t1\t{said}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{k}" for k in range(1, len(names) + 1) for axis in "XYZ"),
        "",
    ]
    rows = []
    for frame in range(count):
        cells = ["" if np.isnan(v) else repr(float(v)) for xyz in lab.values() for v in xyz[:, frame]]
        rows.append("\t".join([str(frame + 1), f"{frame / RATE:.5f}", *cells]))
    return head + rows
