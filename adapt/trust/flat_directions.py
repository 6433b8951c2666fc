"""Description, in words, of directions in which the data hardly determine an adaptation."""

import numpy as np
from jaxtyping import Float

from models.adapted_parameters import ADAPTED

FLAT_MM = 10.0
"""SD above which a direction counts as flat. Two fits of one cadaver's thorax to its points (Table 4.5, MRI and
dissection) differed by less (M_z 5, A_x 2, A_z 9 mm), except for M_y (32) and A_y (40), which interact (4.3.6)."""

_PART = 0.3
"""Movement, as a share of the largest one, above which a parameter is part of a direction."""


def flat_directions(covariance_mm2: Float[np.ndarray, "6 6"]) -> list[str]:
    """Describe the principal directions of a covariance with SD above ``FLAT_MM``, flattest first, a sentence each.

    'M_y and A_y only together: 14 mm against 11 mm' means: one SD along the direction moves M_y by 14 mm and A_y by 11
    mm in the opposite sense ('with': in the same sense), and neither motion nor thorax points reveal this movement.
    """
    if not np.isfinite(covariance_mm2).all():
        return ["not determined: motion and points leave a direction open"]
    variances, directions = np.linalg.eigh(covariance_mm2)
    order = np.argsort(variances)[::-1]
    return [_sentence(np.sqrt(variances[k]) * directions[:, k]) for k in order if variances[k] > FLAT_MM**2]


def _sentence(move_mm: Float[np.ndarray, " 6"]) -> str:
    most = np.abs(move_mm).max()
    part = [k for k in range(len(ADAPTED)) if abs(move_mm[k]) > _PART * most]
    names = [ADAPTED[k] for k in part]
    sizes = [f"{abs(move_mm[k]):.0f} mm" for k in part]
    if len(part) == 1:
        return f"{names[0]} loose: {sizes[0]}"
    words = ["with" if move_mm[k] * move_mm[part[0]] > 0.0 else "against" for k in part[1:]]
    moves = " ".join([sizes[0], *(f"{word} {size}" for word, size in zip(words, sizes[1:], strict=True))])
    return f"{', '.join(names[:-1])} and {names[-1]} only together: {moves}"
