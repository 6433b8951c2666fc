"""The weight of an arm and of a load in the hand, and where along the arm they act.

Masses and centres of mass: D.A. Winter, Biomechanics and Motor Control of Human Movement, 4th ed. 2009, Table 4.1,
after Dempster 1955; lengths of segments: its Figure 4.1, after Drillis and Contini 1966, as shares of the upper arm's.
Assumed: the elbow is straight, the forearm in line with the humerus, and the load is held at the hand's centre of mass.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

GRAVITY_M_S2 = 9.81

UPPER_ARM_SHARE, FOREARM_SHARE = 0.028, 0.022
"""Of the body's mass: upper arm, forearm with hand."""

_UPPER_ARM_CENTRE, _FOREARM_CENTRE, _HAND_CENTRE = 0.436, 0.682, 0.506
"""From the proximal end, of the segment's length; that of forearm with hand of the forearm's."""

_FOREARM, _HAND = 0.146 / 0.186, 0.108 / 0.186
"""Lengths over that of the upper arm; all three are shares of the stature."""


class ArmLoad(NamedTuple):
    """Weights that hang along the line from GH to the elbow."""

    weight_N: Float[np.ndarray, "3"]
    """Upper arm, forearm with hand, load."""
    distance: Float[np.ndarray, "3"]
    """From GH, in lengths of the upper arm."""


def arm_load(body_mass_kg: float, load_kg: float = 0.0) -> ArmLoad:
    """Compute the weights of one arm and a load in its hand, and where they act."""
    masses = np.array([UPPER_ARM_SHARE * body_mass_kg, FOREARM_SHARE * body_mass_kg, load_kg])
    distance = [_UPPER_ARM_CENTRE, 1.0 + _FOREARM_CENTRE * _FOREARM, 1.0 + _FOREARM + _HAND_CENTRE * _HAND]
    return ArmLoad(GRAVITY_M_S2 * masses, np.array(distance))
