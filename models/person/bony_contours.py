"""What points on bones give beside the girdle: joint centres and bony contours of muscles (thesis 4.3.3 and 4.3.5)."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from models.person.joint_centres import acromioclavicular_centre_mm, sternoclavicular_centre_mm
from models.person.least_squares import Points
from models.person.round_surfaces import fit_cylinder, fit_sphere


def described_contours(points_mm: Mapping[str, Points]) -> tuple[str, ...]:
    """Describe, a line each, what the points by surface give: GH and its sphere, the shaft, SC and AC as joints.

    In the thorax frame of the posture in which the points were taken, mm. ValueError where they give no such surface.
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
        found.append(f"SC, middle of the joint surface: {_position(sternoclavicular_centre_mm(points_mm['sc_joint']))}")
    if "clavicle" in points_mm and "scapula" in points_mm:
        joint = acromioclavicular_centre_mm(points_mm["clavicle"], points_mm["scapula"])
        found.append(f"AC, middle of what is within 10 mm of the other bone: {_position(joint)}")
    return tuple(found)


def _position(mm: Float[np.ndarray, "3"]) -> str:
    return f"({', '.join(f'{x:.1f}' for x in mm)}) mm"
