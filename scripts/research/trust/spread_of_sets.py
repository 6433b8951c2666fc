"""How far do the published sets differ in contact, conoid and serratus? The source of the limits of ``girdle trust``.

Every set follows the published rhythm (de Groot & Brand 2001), abduction and forward flexion to 150 degrees. Then every
set in turn stands for an adaptation of every other set: a difference that occurs between cadavers needs no warning.
"""

import argparse
from dataclasses import replace
from itertools import permutations

import numpy as np
from jaxtyping import Float
from numpy.random import PCG64, Generator

from adapt.api import fit_postures
from adapt.solvers import status
from models import load_model
from models.muscles.contact import FORCES, angle_deg, contact_forces
from models.muscles.muscle_lines import muscle_lines
from models.muscles.pulls import muscle_arms_mm, pulls
from motions.rhythm import COEFFICIENTS, REST_DEG
from motions.rhythm_subjects import ELEVATIONS_DEG, MOTION_PLANES_DEG, noise_free_subjects, subject_angles_deg
from motions.table import Motions
from scripts.reporting import CADAVER_SETS


def rhythm() -> Motions:
    """Return the published rhythm of a mean person, without spread or noise."""
    plane = np.repeat(list(MOTION_PLANES_DEG.values()), len(ELEVATIONS_DEG))
    elevation = np.tile(ELEVATIONS_DEG, len(MOTION_PLANES_DEG))
    angles = subject_angles_deg(REST_DEG[:, None], COEFFICIENTS[..., None], plane, elevation)
    return replace(noise_free_subjects(1, Generator(PCG64(0))), angles_deg=angles[:, 0].T.copy())


def spread() -> dict[str, Float[np.ndarray, " pairs"]]:
    """Compute the differences between every two sets: mean angle of each force, degrees, and ratios of arms."""
    motions = rhythm()
    fits = fit_postures(motions, [load_model(name) for name in CADAVER_SETS]).by_model
    good = np.all([fits[name].status == status.OK for name in CADAVER_SETS], axis=0)
    directions, arms = {}, {}
    for name in CADAVER_SETS:
        model, angles = load_model(name), fits[name].angles[:, good]
        girdle, lines = model.girdle.repeated(angles.shape[1]), muscle_lines(model)
        directions[name] = contact_forces(girdle, angles).direction
        found = pulls(lines, girdle, angles)
        which = lines.muscles.index("serratus_anterior")
        for joint in ("sc", "ac"):
            each = muscle_arms_mm(lines, getattr(found, f"about_{joint}_mm"))[which]
            arms[name, joint] = np.mean([each[motions.motion[good] == m].mean() for m in MOTION_PLANES_DEG])
    differences = {}
    for k, force in enumerate(FORCES):
        turned = [angle_deg(directions[a][:, k], directions[b][:, k]).mean() for a, b in permutations(CADAVER_SETS, 2)]
        differences[f"{force} turned, deg"] = np.array(turned)
    for joint in ("sc", "ac"):
        ratios = [arms[b, joint] / arms[a, joint] for a, b in permutations(CADAVER_SETS, 2)]
        differences[f"serratus about {joint.upper()}, ratio"] = np.array(ratios)
    return differences


def main() -> None:
    """Print the median and the largest difference."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    for name, values in spread().items():
        print(f"{name:30} median {np.median(values):6.2f}  largest {values.max():6.2f}")


if __name__ == "__main__":
    main()
