"""The constraints of a posture with their derivatives, as the reference solvers need them.

z = (q, theta): six angles and, where they are free, the adapted parameters; elementwise over the batch.
"""

from typing import Protocol

from jaxtyping import Float

from adapt.solvers.reference.elimination import Linearised
from adapt.solvers.reference.linalg import ElementwiseFunction, gradient, hessian, jacobian
from models.adapted_parameters import ADAPTED, ELLIPSOID, adapted_components
from models.derivatives import ConstraintDerivatives, chain, closest_point_multipliers
from models.girdle import Girdle
from motions.arrays import Array, xp

Z = Float[Array, " n *batch"]
Multipliers = Float[Array, " 3 *batch"]


class Constraints(Protocol):
    """g(z), mm, and its derivatives."""

    def residual(self, z: Z) -> Float[Array, " 3 *batch"]: ...
    def slopes(self, z: Z) -> Float[Array, " 3 n *batch"]: ...
    def multiplier_gradient(self, z: Z, multipliers: Multipliers) -> Z: ...  # d(multipliers . g)/dz
    def linearised(self, z: Z, multipliers: Multipliers) -> Linearised: ...


class Differentiated:
    """Any constraints, by automatic differentiation: with effects, and where they are differentiated further."""

    def __init__(self, function: ElementwiseFunction):
        self._function = function

    def residual(self, z):
        """Compute g(z), mm, three rows."""
        return self._function(z)

    def slopes(self, z):
        """Compute dg/dz, mm per unit of z, three rows."""
        return jacobian(self._function, z)

    def multiplier_gradient(self, z, multipliers):
        """Compute d(multipliers . g)/dz."""
        return gradient(lambda z: xp.sum(multipliers * self.residual(z), axis=0), z)

    def linearised(self, z, multipliers):
        """Linearise g at z: g, G = dg/dq, T = dg/dtheta and d2(multipliers . g)/dz2."""
        slopes = self.slopes(z)
        curvature = hessian(lambda z: xp.sum(multipliers * self.residual(z), axis=0), z)
        return Linearised(self.residual(z), slopes[:, :6], slopes[:, 6:], curvature)


class ByHand:
    """A girdle's own, by the formulas of ``models.derivatives``: quick to trace, and for numpy too.

    g and the closest points come from ``models.girdle`` and ``models.ellipsoid``, exact from far away.
    """

    def __init__(self, girdle: Girdle):
        self.girdle = girdle

    def residual(self, z):
        """Compute g(z), mm, three rows."""
        return self._at(z).residuals_mm(z[:6])

    def slopes(self, z):
        """Compute dg/dz, mm per unit of z, three rows."""
        c = self._chain(z, xp.zeros_like(z[:3]))
        G = xp.stack([_stacked(row, z) for row in c.G])
        return G if len(z) == 6 else xp.concatenate([G, _parameter_slopes(c, z)], axis=1)

    def multiplier_gradient(self, z, multipliers):
        """Compute d(multipliers . g)/dz."""
        return xp.sum(multipliers[:, None] * self.slopes(z), axis=0)

    def linearised(self, z, multipliers):
        """Linearise g at z: g, G = dg/dq, T = dg/dtheta and d2(multipliers . g)/dz2."""
        c, n = self._chain(z, multipliers), len(z)
        zero = 0.0 * z[0]
        rows = [list(row) + [zero] * (n - len(row)) for row in c.qq]
        if n > 6:
            rows += [
                [x[k] for x in c.qu] + list(c.uu[k]) + [zero] * (len(ADAPTED) - 1 - k) for k in range(len(ELLIPSOID))
            ]
            rows += [[zero] * n]
        lower = [_stacked(row, z) for row in rows]
        entries = [[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]
        curvature = xp.stack([xp.stack(row) for row in entries])
        G = xp.stack([_stacked(row, z) for row in c.G])
        T = _parameter_slopes(c, z) if n > 6 else G[:, :0]
        return Linearised(xp.stack(c.g), G, T, curvature)

    def _at(self, z) -> Girdle:
        return self.girdle.with_adapted(z[6:]) if len(z) > 6 else self.girdle

    def _chain(self, z, multipliers) -> ConstraintDerivatives:
        girdle = self._at(z)
        q, theta = list(z[:6]), adapted_components(girdle)
        return chain(girdle, q, theta, list(multipliers), closest_point_multipliers(girdle, q, theta))


def _stacked(row, z):
    return xp.stack([xp.broadcast_to(x, z[0].shape) for x in row])


def _parameter_slopes(c: ConstraintDerivatives, z):
    """dg/dtheta, three rows: A1 and A2 of the ellipsoid, A3 of the conoid's length."""
    zero = 0.0 * z[0]
    return xp.stack(
        [_stacked(row, z) for row in ([*c.T[0], zero], [*c.T[1], zero], [zero] * len(ELLIPSOID) + [zero - 1.0])]
    )
