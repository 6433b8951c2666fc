"""Weights of an arm and of a load in the hand, and their points of application along the arm.

Masses and centres of mass: D.A. Winter, Biomechanics and Motor Control of Human Movement, 4th ed. 2009, Table 4.1,
after Dempster 1955; lengths of segments: Figure 4.1 of that book, after Drillis and Contini 1966, as shares of the
upper arm's length. Assumed: the elbow is straight, with the forearm in line with the humerus, and the load is held at
the hand's centre of mass.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

GRAVITY_M_S2 = 9.81

UPPER_ARM_SHARE, FOREARM_SHARE = 0.028, 0.022
"""Mass of the upper arm, and of the forearm with hand, as shares of the body mass."""

_UPPER_ARM_CENTRE, _FOREARM_CENTRE, _HAND_CENTRE = 0.436, 0.682, 0.506
"""Distances of the centres of mass from the proximal end, as shares of the segment's length; for the forearm with hand,
of the forearm's length."""

_FOREARM, _HAND = 0.146 / 0.186, 0.108 / 0.186
"""Lengths of forearm and hand over the length of the upper arm; the source gives all three as shares of the stature."""


class ArmLoad(NamedTuple):
    """Weights that hang along the line from GH to the elbow."""

    weight_N: Float[np.ndarray, "3"]
    """Weights of upper arm, forearm with hand, and load."""
    distance: Float[np.ndarray, "3"]
    """Distances from GH, in lengths of the upper arm."""


def arm_load(body_mass_kg: float, load_kg: float = 0.0) -> ArmLoad:
    """Compute the weights of one arm and of a load in its hand, with their distances from GH."""
    masses = np.array([UPPER_ARM_SHARE * body_mass_kg, FOREARM_SHARE * body_mass_kg, load_kg])
    distance = [_UPPER_ARM_CENTRE, 1.0 + _FOREARM_CENTRE * _FOREARM, 1.0 + _FOREARM + _HAND_CENTRE * _HAND]
    return ArmLoad(GRAVITY_M_S2 * masses, np.array(distance))
