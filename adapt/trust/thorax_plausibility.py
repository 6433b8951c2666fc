"""Checks whether an adapted ellipsoid's size, its distances to thorax points, TS and AI, and the conoid length could be
a person's.

Each check has limits with a reason. A value outside the limits gives a warning, not a failure: the fit stands, but the
ellipsoid is then only a device that lets the scapula move as measured, not a thorax. An ellipsoid within the limits
need not be a thorax: its shape is checked only near the thorax points. ``adapt.trust.changed_forces`` checks its
effects on contact, conoid and serratus (thesis 6.4).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from models.ellipsoid import signed_distance_mm
from models.parameter_sets import ParameterSet
from models.person.sizes import DEEPEST_MM

PASS, WARNING = "pass", "warning"

DEPTH_MM = (143.0, 275.0)
WIDTH_MM = (222.0, 356.0)
"""Smallest and largest chest of 507 adults: depth between spine and sternum, and width (the diameter), at the nipples,
both "skeletal" (G. Heinz et al., Exploring relationships in body dimensions, J. Stat. Educ. 11(2), 2003). The published
ellipsoids of four cadavers are 171 to 260 mm deep and 266 to 306 mm wide."""

_ADULTS = "the chests of 507 adults (Heinz 2003)"

_MARGIN = 0.1
"""Share by which limits extend beyond the smallest and largest of four cadavers, who do not represent everybody.
Assumed."""

VOLUME_L = (8.6 * (1 - _MARGIN), 33.7 * (1 + _MARGIN))
"""Volumes of the smallest and the largest published ellipsoid, with the margin. No chest limits the volume: the thorax
points leave A_y undetermined, so that even published ellipsoids are no thoraxes as a whole (R2's reaches 700 mm below
IJ and holds 34 l, for a body of 73 kg, Table 3.1). Chests limit depth and width; the volume detects an A_y that ran
away."""

_ELLIPSOIDS = "published ellipsoids of four cadavers (Tables 3.3 and 4.5, DAS3) and a tenth beyond"

CHEST_DEPTH_MM = {"R2": 197.0, "R4": 253.0, "R6": 221.0}
"""Chest depths measured from outside (Table 3.1)."""

DEEPER_THAN_CHEST = 1.32
"""Limit of the ellipsoid's depth over the chest depth: R2's own ellipsoid, 260 mm for a chest of 197 mm, has the
largest published ratio."""

REGION_MM = 15.0
"""Limit of the root mean square distance of the thorax points of a region. Two published fits of one cadaver's thorax
(MRI, dissection and DAS3) have such distances of 1 to 15 mm per region to each other's points; a larger distance means
a different thorax. A smooth surface does not follow ribs much more closely: in 50 patients the root mean square
distance of the best sphere to the ribs under the scapula was 7.9 (SD 1.9) mm for ribs 2 to 5 and 10.1 (1.9) for ribs 5
to 8 (T. Paquet et al., Defining the shape of the scapulothoracic gliding surface, Surg. Radiol. Anat. 41, 2019)."""

CONTACT_MM = (DEEPEST_MM, 45.7 * (1 + _MARGIN))
"""Limits of the distances of TS and AI to the ellipsoid (constraints A1 and A2): from the depth that palpation noise
allows to a tenth beyond the largest distance of the shipped sets (TS of breteler_mri). An adaptation does not change
the distances, but a set of landmarks with another person's thorax can have any."""

CONOID_MM = (1.0, 12.3 + 2 * 6.6)
"""Limits of the conoid length: up to two SDs above the mean of men, 12.3 mm (SD 6.6; eorif.com, AC anatomy; the thesis,
3.3.1, says 13). In 52 fresh shoulders the length was 14.2 (2.4) and 15.9 (3.0) mm, left and right (an abstract in WPRIM
by Y.-F. Jin and others): they vary less, but come from one population. The models' own lengths are 13.2 to 18.3."""

REGIONS = {"front": (-180.0, -15.0), "side": (-15.0, 27.5), "back": (27.5, 180.0)}
"""Azimuth ranges from lateral toward backward, degrees, with limits halfway between the columns of the shipped points:
origins of the serratus, the part round which the serratus wraps, and the part under the scapula (thesis 6.2.6)."""


@dataclass(frozen=True)
class Check:
    """One quantity of an adapted girdle and its limits."""

    name: str
    value: float
    low: float
    high: float
    unit: str
    reason: str

    @property
    def verdict(self) -> str:
        """``pass`` or ``warning``; NaN gives ``warning``."""
        return PASS if self.low <= self.value <= self.high else WARNING

    def row(self, model: str, subject: str, own_value: float) -> dict[str, object]:
        """Return the row of ``plausibility.csv``; ``own_value`` is the value of the parameter set itself."""
        row: dict[str, object] = {"model": model, "subject": subject, "check": self.name}
        row |= {"value": self.value, "own_value": own_value, "low": self.low, "high": self.high}
        return row | {"unit": self.unit, "verdict": self.verdict, "reason": self.reason}


def checks(model: ParameterSet, theta_mm: Float[np.ndarray, " adapted"]) -> list[Check]:
    """Return the checks of size and distance of one adaptation; ``theta_mm`` is in the order of
    ``ADAPTED_PARAMETERS``."""
    adapted = model.girdle.with_adapted(theta_mm)
    A_x, A_y, A_z = (float(x) for x in adapted.semi_axes_mm)
    conoid = float(adapted.conoid_length_mm)
    volume = 4.0 / 3.0 * np.pi * A_x * A_y * A_z / 1e6
    found = [
        Check("depth", 2.0 * A_z, *DEPTH_MM, "mm", f"2 A_z; {_ADULTS}"),
        Check("width", 2.0 * A_x, *WIDTH_MM, "mm", f"2 A_x; {_ADULTS}"),
        Check("volume", volume, *VOLUME_L, "l", f"4/3 pi A_x A_y A_z; {_ELLIPSOIDS}"),
        Check("conoid", conoid, *CONOID_MM, "mm", "length of the ligament in men, 12.3 (SD 6.6) mm, two SDs"),
    ]
    reason = "distance to the ellipsoid that the set holds; negative is inside the thorax"
    for name, distance in (("TS", adapted.ts_distance_mm), ("AI", adapted.ai_distance_mm)):
        found.append(Check(f"distance of {name}", float(distance), *CONTACT_MM, "mm", reason))
    if model.name in CHEST_DEPTH_MM:
        ratio = 2.0 * A_z / CHEST_DEPTH_MM[model.name]
        reason = f"2 A_z over the chest depth of {model.name} (Table 3.1); R2's own is 1.32"
        found.append(Check("depth over chest depth", ratio, 1.0 / DEEPER_THAN_CHEST, DEEPER_THAN_CHEST, "", reason))
    reason = "rms distance of the thorax points there; two fits of one cadaver's thorax differ by up to 15 mm"
    for name, distance in region_distances_mm(model, theta_mm).items():
        found.append(Check(f"thorax points, {name}", distance, 0.0, REGION_MM, "mm", reason))
    return found


def region_distances_mm(model: ParameterSet, theta_mm: Float[np.ndarray, " adapted"]) -> dict[str, float]:
    """Compute the root mean square distance of each region's thorax points to the adapted ellipsoid, mm.

    A point on the left counts as its mirror image, as the ellipsoid is symmetric. Regions without points are left out.
    """
    moved, own, points = model.girdle.with_adapted(theta_mm), model.girdle, model.points_mm
    distance = signed_distance_mm(points, moved.centre_mm[:, None], moved.semi_axes_mm[:, None])
    scaled = (points - own.centre_mm[:, None]) / own.semi_axes_mm[:, None]
    azimuth = np.degrees(np.arctan2(scaled[2], np.abs(scaled[0])))
    inside = {name: (azimuth >= low) & (azimuth < high) for name, (low, high) in REGIONS.items()}
    return {name: float(np.sqrt(np.mean(distance[part] ** 2))) for name, part in inside.items() if part.any()}
