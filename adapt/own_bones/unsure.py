"""Corrections of the posterior covariance of sizes, which is too small with linearised constraints and known scales.

With C the linearised posterior covariance of sizes of prior variance 1 (``own_bones.most_probable``), r the roots of
beta from curved ridges (``own_bones.curved_posterior``), and D the relative variances of the scales of the sizes'
groups (variance over the squared scale),

    C' = C + r (1 - C) r,    covariance C' + C' D C'.

The last term adds the uncertainty of scales that few persons determine poorly. With a prior variance P = S^2 the
posterior mean m changes by C P^-1 dP P^-1 m, and C by its second derivative too. Over persons who differ as S says,
E(m m') = P - C, and the sum of both changes is C D C: a size that the data determine well hardly depends on its scale.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.own_bones.scales import GROUP_OF_SIZE
from models.person.own_bones import GROUPS

Values = Float[np.ndarray, "groups problems"]


class Unsure(NamedTuple):
    """Corrections per group of sizes."""

    untold: Values
    """Fraction beta of the linearised information that the motions do not contain."""
    scale_variance: Values
    """Variance of the learnt scale relative to its square; 0 where no scale was learnt."""

    @classmethod
    def nothing(cls, count: int) -> "Unsure":
        """Return zeros, which stand for exact linearisation and known scales."""
        return cls(np.zeros((len(GROUPS), count)), np.zeros((len(GROUPS), count)))


def told_and_covariance(
    before: Float[np.ndarray, "problems sizes sizes"], told: Float[np.ndarray, "problems sizes sizes"], unsure: Unsure
) -> tuple[Float[np.ndarray, "problems sizes"], Float[np.ndarray, "problems sizes sizes"]]:
    """Compute 1 - C' and the covariance of sizes whose own prior variance is 1.

    ``before``: covariance without the angles; ``told``: its reduction by the angles, linearised.
    """
    roots, D = np.sqrt(unsure.untold).T[:, GROUP_OF_SIZE], unsure.scale_variance.T[:, GROUP_OF_SIZE]
    C = before - told + roots[:, :, None] * told * roots[:, None]
    each = range(C.shape[1])
    C[:, each, each] = np.maximum(C[:, each, each], 0.0)  # rounding can make the variance of a fixed size negative
    return 1.0 - C[:, each, each], C + C @ (D[:, :, None] * C)
