"""Frames, signs and columns of the motion files that this world writes.

Right shoulder; thorax frame x lateral, y up, z backward, origin IJ; a bone's orientation is R = Ry(y) Rz(z) Rx(x).
Lengths are in mm; angles are in deg where the name ends in `_deg`, else in rad.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]

ANGLES = ("clavicle_y_deg", "clavicle_z_deg", "clavicle_x_deg", "scapula_y_deg", "scapula_z_deg", "scapula_x_deg")
LANDMARKS = ("SC", "AC", "TS", "AI")
PARAMETERS = ("M_y_mm", "M_z_mm", "A_x_mm", "A_y_mm", "A_z_mm", "conoid_length_mm")
PLANES_DEG = {"abduction": 0.0, "scapular_plane": 30.0, "forward_flexion": 90.0}
"""Plane of the humerus in each motion: 0 abduction, 90 forward flexion."""
DEG = np.pi / 180.0
SUBJECT_STREAM, EFFECT_STREAM, NOISE_STREAM, LANDMARK_STREAM, PEOPLE_STREAM = 1, 2, 3, 4, 5
"""Streams of random numbers: worlds of one seed share subjects and noise, whatever their effect."""
