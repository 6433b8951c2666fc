"""Of sizes, what slopes at the optimum with scales that are known are too sure of.

With C the posterior covariance of sizes, the prior's 1, by slopes (``own_bones.most_probable``), r the roots of what
curved ridges do not tell (``own_bones.curved_posterior``), and D the variances of the scales of their groups, relative
to the scales' squares,

    C' = C + r (1 - C) r,    covariance C' + C' D C'.

The last term is that of scales which few persons do not tell well. With a prior variance P = S^2 the posterior mean m
moves by C P^-1 dP P^-1 m, and C by its second derivative, too. Over persons who differ as S says, E(m m') = P - C, and
the sum of both is C D C: a size that is told well does not hang on the scale.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from adapt.own_bones.scales import GROUP_OF_SIZE
from models.person.own_bones import GROUPS

Values = Float[np.ndarray, "groups problems"]


class Unsure(NamedTuple):
    """Of each group."""

    untold: Values
    """The share of what slopes say that motions tell that they do not."""
    scale_variance: Values
    """Of the scale that was learnt, relative to its square; 0 where none was."""

    @classmethod
    def nothing(cls, count: int) -> "Unsure":
        """Slopes and scales are right."""
        return cls(np.zeros((len(GROUPS), count)), np.zeros((len(GROUPS), count)))


def told_and_covariance(
    before: Float[np.ndarray, "problems sizes sizes"], told: Float[np.ndarray, "problems sizes sizes"], unsure: Unsure
) -> tuple[Float[np.ndarray, "problems sizes"], Float[np.ndarray, "problems sizes sizes"]]:
    """Compute 1 - C' of each size, and the covariance, of sizes whose own prior is 1.

    ``before``: before any angle is looked at; ``told``: what slopes say that angles take away from it.
    """
    roots, D = np.sqrt(unsure.untold).T[:, GROUP_OF_SIZE], unsure.scale_variance.T[:, GROUP_OF_SIZE]
    C = before - told + roots[:, :, None] * told * roots[:, None]
    each = range(C.shape[1])
    C[:, each, each] = np.maximum(C[:, each, each], 0.0)  # of a size that is held, but for rounding
    return 1.0 - C[:, each, each], C + C @ (D[:, :, None] * C)
