"""Joint centres and bony contours of muscles from points on bones (thesis 4.3.3 and 4.3.5)."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from models.person.least_squares import Points
from models.person.round_surfaces import fit_cylinder, fit_sphere

NEAR_MM = 10.0
"""Points of the clavicle or scapula that are closer than this to the other bone belong to the AC joint (4.3.3)."""


def described_contours(points_mm: Mapping[str, Points]) -> tuple[str, ...]:
    """Describe the fitted surfaces and joint centres, one line each: GH and its sphere, the humeral shaft, SC and AC.

    ``points_mm`` has the points of each surface. Positions are in mm in the thorax frame of the posture in which the
    points were measured. ValueError where the points do not determine their surface.
    """
    found = []
    if "humeral_head" in points_mm:
        sphere = fit_sphere(points_mm["humeral_head"])
        found.append(
            f"GH, centre of the humeral head: {_position(sphere.centre_mm)}, radius {sphere.radius_mm:.2f} +- "
            f"{sphere.fit.sd[3]:.2f} mm, {sphere.volume_cm3:.1f} cm3 (rms {sphere.fit.rms_mm:.2f} mm)"
        )
    if "humeral_shaft" in points_mm:
        shaft = fit_cylinder(points_mm["humeral_shaft"])
        direction = ", ".join(f"{x:.3f}" for x in shaft.direction)
        found.append(
            f"humeral shaft: through {_position(shaft.point_mm)} along ({direction}), radius {shaft.radius_mm:.2f} +- "
            f"{shaft.fit.sd[4]:.2f} mm (rms {shaft.fit.rms_mm:.2f} mm)"
        )
    if "sc_joint" in points_mm:
        found.append(f"SC, middle of the joint surface: {_position(points_mm['sc_joint'].mean(axis=1))}")
    if "clavicle" in points_mm and "scapula" in points_mm:
        joint = acromioclavicular_centre_mm(points_mm["clavicle"], points_mm["scapula"])
        found.append(f"AC, middle of what is within {NEAR_MM:g} mm of the other bone: {_position(joint)}")
    return tuple(found)


def acromioclavicular_centre_mm(clavicle_mm: Points, scapula_mm: Points) -> Float[np.ndarray, "3"]:
    """Compute the AC joint centre: the mean of the points of either bone that lie within ``NEAR_MM`` of the other bone.

    ValueError where no points of the two bones are so close.
    """
    apart = np.linalg.norm(clavicle_mm[:, :, None] - scapula_mm[:, None, :], axis=0)
    near = clavicle_mm[:, apart.min(axis=1) < NEAR_MM], scapula_mm[:, apart.min(axis=0) < NEAR_MM]
    if not near[0].shape[1]:
        raise ValueError(
            f"clavicle and scapula come no nearer than {apart.min():.1f} mm, and the AC joint is within {NEAR_MM:g} mm"
        )
    return np.concatenate(near, axis=1).mean(axis=1)


def _position(mm: Float[np.ndarray, "3"]) -> str:
    return f"({', '.join(f'{x:.1f}' for x in mm)}) mm"
