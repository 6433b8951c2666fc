"""Constraints A1-A3 with first and second derivatives written out by hand: the fast path of the fits.

The functions are those of ``models.girdle`` and ``models.ellipsoid``; the derivatives take a quarter of the operations
of automatic differentiation. Vectors are tuples of three arrays and matrices are tuples of rows, so that every
operation is elementwise and the compiler may fuse it with its neighbours. Lengths in mm, angles in rad.
tests/models/test_derivatives.py compares every number with automatic differentiation.

**Rotations.** A bone point r = R v, R = Ry(a) Rz(b) Rx(c), turns about the axes e_a = y, e_b = Ry z and e_c = R x:

    dr/dq_i = e_i x r,     d2r/dq_i dq_j = e_i x (e_j x r)   for i <= j,

so n . r, with n fixed, has the second derivatives  e_i' (N - tr N) e_j  with the moment matrix N = r n'.

**Distance.** The closest point x to p (``models.ellipsoid``) satisfies p - x = t m with m_i = p_i / (t + a_i^2), and
sum a_i^2 m_i^2 = 1 determines t. With D_i = 1 / (t + a_i^2), w = D m, L = |m|, n = m / L, h = sum a_i^2 m_i^2 D_i:

    d = t L,   dd/dp = n,   dd/da_i = e_i = -a_i m_i n_i,   dt/da_j = y_j = a_j m_j^2 (t - a_j^2) D_j / h
    d2d/dp2     = (diag D + (t w w' - w m' - m w' + (m.w / L^2) m m') / h) / L          (the surface's curvature)
    d2d/dp da   = -((w - n (n.w)) y' + 2 diag(a w) - 2 n (n a w)') / L
    d2d/da_i da_j = 2 a_i m_i w_i y_j / L + e_i (n.w y_j + 2 n_j a_j w_j) / L + [i = j] (4 a_i^2 m_i w_i - m_i^2) / L
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from models.adapted_parameters import ELLIPSOID, AdaptedParameter, conoid_length, ellipsoid_components
from models.ellipsoid import closest_point_multiplier
from motions.arrays import Array, xp

Vector = tuple[Array, Array, Array]
Matrix = tuple[Vector, Vector, Vector]


def dot(u: Vector, v: Vector) -> Array:
    """Compute u . v."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Vector, v: Vector) -> Vector:
    """Compute u x v."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


def _sum(*vectors: Vector) -> Vector:
    x, y, z = vectors[0]
    for v in vectors[1:]:
        x, y, z = x + v[0], y + v[1], z + v[2]
    return x, y, z


def _minus(u: Vector, v: Vector) -> Vector:
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


def _times(s, v: Vector) -> Vector:
    return s * v[0], s * v[1], s * v[2]


class Bone(NamedTuple):
    """Orientation of a bone in the thorax frame: the columns of R, and sine and cosine of a, which give e_b."""

    x: Vector
    y: Vector
    z: Vector
    sin_a: Array
    cos_a: Array

    def rotate(self, v: Vector) -> Vector:
        """Compute R v."""
        return _sum(_times(v[0], self.x), _times(v[1], self.y), _times(v[2], self.z))

    def spin(self, r: Vector) -> Matrix:
        """Compute e_a x r, e_b x r and e_c x r."""
        s, c = self.sin_a, self.cos_a
        return (
            (r[2], xp.zeros_like(r[0]), -r[0]),
            (-c * r[1], c * r[0] - s * r[2], s * r[1]),
            cross(self.x, r),
        )

    def curvature(self, N: Matrix) -> dict[tuple[int, int], Array]:
        """Compute e_i' (N - tr N) e_j for i <= j."""
        s, c = self.sin_a, self.cos_a
        turn = N[0][0] + N[1][1] + N[2][2]
        Q = tuple(tuple(N[i][j] - turn if i == j else N[i][j] for j in range(3)) for i in range(3))
        b = tuple(Q[i][0] * s + Q[i][2] * c for i in range(3))
        x = tuple(dot(Q[i], self.x) for i in range(3))  # pyright: ignore[reportArgumentType]
        return {
            (0, 0): Q[1][1],
            (0, 1): b[1],
            (0, 2): x[1],
            (1, 1): s * b[0] + c * b[2],
            (1, 2): s * x[0] + c * x[2],
            (2, 2): dot(self.x, x),  # pyright: ignore[reportArgumentType]
        }


def bone(angles: Vector) -> Bone:
    """Compute R = Ry(a) Rz(b) Rx(c) of a bone (``motions.rotations.rotation_from_cardan``)."""
    (ca, cb, cc), (sa, sb, sc) = (tuple(f(x) for x in angles) for f in (xp.cos, xp.sin))
    return Bone(
        (ca * cb, sb, -sa * cb),
        (sa * sc - ca * sb * cc, cb * cc, ca * sc + sa * sb * cc),
        (sa * cc + ca * sb * sc, -cb * sc, ca * cc - sa * sb * sc),
        sa,
        ca,
    )


class Distance(NamedTuple):
    """Signed distance of a point to the ellipsoid, with derivatives with respect to the point p and the semi-axes a."""

    d: Array
    n: Vector
    """dd/dp, the outward normal."""
    e: Vector
    """dd/da."""
    pp: Matrix
    pa: Matrix
    """d2d/dp_i da_j in row i, column j."""
    aa: Matrix
    t: Array
    """Multiplier of the closest point, mm^2: the initial guess of the next evaluation."""


FOOT_STEPS = 3
"""Newton steps for the multiplier of a closest point (foot). From the multiplier of a point some 20 mm away they are
exact to 1e-6 mm, from 1 mm away to rounding. These steps suffice, because the multiplier is passed from iteration to
iteration and the points come to rest before the iterations end."""


def closest_point_multiplier_near(p: Vector, a: Vector, t: Array) -> Array:
    """Solve S(t) = sum (a_i p_i / (t + a_i^2))^2 = 1 for t, by Newton steps on the nearly linear 1 - S^(-1/2)."""
    for _ in range(FOOT_STEPS):
        D = tuple(1.0 / (t + x * x) for x in a)
        terms = tuple((x * y * z) ** 2 for x, y, z in zip(a, p, D, strict=True))
        S = terms[0] + terms[1] + terms[2]
        t = t + (xp.sqrt(S) - 1.0) * S / (terms[0] * D[0] + terms[1] * D[1] + terms[2] * D[2])
    return t


def distance(p: Vector, a: Vector, t: Array) -> Distance:
    """Compute d and its derivatives from the multiplier t of the closest point; exact where S(t) = 1."""
    D: Vector = tuple(1.0 / (t + x * x) for x in a)  # type: ignore[assignment]
    m: Vector = p[0] * D[0], p[1] * D[1], p[2] * D[2]
    w: Vector = m[0] * D[0], m[1] * D[1], m[2] * D[2]
    aw: Vector = a[0] * w[0], a[1] * w[1], a[2] * w[2]
    squared = dot(m, m)
    shorter = 1.0 / xp.sqrt(squared)  # 1 / L
    n = _times(shorter, m)
    mw, nw = dot(m, w), dot(n, w)
    h = 1.0 / (squared - t * mw)  # 1 / h
    e: Vector = tuple(-a[k] * m[k] * n[k] for k in range(3))  # type: ignore[assignment]
    y = tuple(aw[k] * m[k] * (t - a[k] * a[k]) * h for k in range(3))
    tangent = _minus(w, _times(nw, n))

    def pp(i, j):
        rest = (t * w[i] * w[j] - w[i] * m[j] - m[i] * w[j] + mw / squared * m[i] * m[j]) * h
        return (D[i] + rest if i == j else rest) * shorter

    def pa(i, j):
        rest = tangent[i] * y[j] - 2.0 * n[i] * n[j] * aw[j]
        return -(rest + 2.0 * aw[i] if i == j else rest) * shorter

    def aa(i, j):
        rest = 2.0 * a[i] * m[i] * w[i] * y[j] + e[i] * (nw * y[j] + 2.0 * n[j] * aw[j])
        return (rest + 4.0 * a[i] * m[i] * aw[i] - m[i] * m[i] if i == j else rest) * shorter

    def matrix(entry) -> Matrix:
        return tuple(tuple(entry(i, j) for j in range(3)) for i in range(3))  # type: ignore[return-value]

    return Distance(t * squared * shorter, n, e, matrix(pp), matrix(pa), matrix(aa), t)


class ConstraintDerivatives(NamedTuple):
    """Constraints g = (A1, A2, A3), mm, and their derivatives with respect to the six angles q and the adapted
    parameters u of the ellipsoid (``models.adapted_parameters.ELLIPSOID``).

    The second derivatives are those of multipliers . g; symmetric matrices hold the entries j <= i only.
    dg/dconoid_length is (0, 0, -1).
    """

    g: list[Array]
    G: list[list[Array]]
    """dg/dq, three rows of six."""
    T: list[list[Array]]
    """d(A1, A2)/du, two rows."""
    qq: list[list[Array]]
    qu: list[list[Array]]
    uu: list[list[Array]]
    closest_point_multipliers: list[Array]
    """t of TS and AI after ``FOOT_STEPS`` more Newton steps, mm^2."""


def _by_parameter(centre: Callable[[int], Array], semi_axis: Callable[[int], Array]) -> list[Array]:
    """List the value of ``centre`` or ``semi_axis`` at the component of each ellipsoid parameter."""
    return [semi_axis(one.component) if one.is_length else centre(one.component) for one in ELLIPSOID]


def ellipsoid_slope(at: Distance) -> list[Array]:
    """Compute dd/du; moving the centre acts as moving the point the opposite way."""
    return _by_parameter(lambda k: -at.n[k], lambda k: at.e[k])


def ellipsoid_curvature(at: Distance) -> list[list[Array]]:
    """Compute d2d/du2, entries j <= i."""

    def entry(one: AdaptedParameter, other: AdaptedParameter) -> Array:
        i, j = one.component, other.component
        if one.is_length and other.is_length:
            return at.aa[i][j]
        if one.is_length:
            return -at.pa[j][i]
        return -at.pa[i][j] if other.is_length else at.pp[i][j]

    return [[entry(one, other) for other in ELLIPSOID[: i + 1]] for i, one in enumerate(ELLIPSOID)]


def closest_point_multipliers(girdle, q: Sequence[Array], theta: Sequence[Array]) -> list[Array]:
    """Compute t of the closest points of TS and AI from any distance, mm^2: the initial guess of :func:`chain`."""
    clavicle, scapula = bone((q[0], q[1], q[2])), bone((q[3], q[4], q[5]))
    centre, semi_axes = ellipsoid_components(girdle, theta)
    ac_from_centre = _minus(_sum(tuple(girdle.sc_mm), clavicle.rotate(tuple(girdle.ac_mm))), centre)
    points = [_sum(ac_from_centre, scapula.rotate(tuple(v))) for v in (girdle.ts_mm, girdle.ai_mm)]
    return [closest_point_multiplier(point, semi_axes) for point in points]


def chain(
    girdle, q: list[Array], theta: list[Array], multipliers: list[Array], closest_point_multipliers: list[Array]
) -> ConstraintDerivatives:
    """Evaluate the constraints, with derivatives, at angles q and adapted parameters theta.

    ``closest_point_multipliers`` are t of TS and AI at nearby q and theta; ``FOOT_STEPS`` Newton steps refine them.
    ``girdle`` is a ``models.girdle.Girdle``, whose own values of the adapted parameters are ignored.
    """
    clavicle, scapula = bone((q[0], q[1], q[2])), bone((q[3], q[4], q[5]))
    centre, a = ellipsoid_components(girdle, theta)
    to_ac = clavicle.rotate(tuple(girdle.ac_mm))
    sc_to_centre = _minus(centre, tuple(girdle.sc_mm))
    ac_from_centre = _minus(to_ac, sc_to_centre)
    ac_spin = clavicle.spin(to_ac)

    g, G, T = [], [], []
    zero = xp.zeros_like(q[0])
    qq = [[zero] * (i + 1) for i in range(6)]
    qu = [[zero] * len(ELLIPSOID) for _ in range(6)]
    uu = [[zero] * (i + 1) for i in range(len(ELLIPSOID))]
    forces, arms, moved = [], [], []
    for own, v, constant, t in zip(
        multipliers,
        (girdle.ts_mm, girdle.ai_mm),
        (girdle.ts_distance_mm, girdle.ai_distance_mm),
        closest_point_multipliers,
        strict=False,
    ):
        arm = scapula.rotate(tuple(v))
        point = _sum(ac_from_centre, arm)
        at = distance(point, a, closest_point_multiplier_near(point, a, t))
        J = (*ac_spin, *scapula.spin(arm))
        g.append(at.d - constant)
        G.append([dot(column, at.n) for column in J])
        T.append(ellipsoid_slope(at))
        _add_curvature(qq, qu, uu, own, J, at)
        forces.append(_times(own, at.n))
        arms.append(arm)
        moved.append(at.t)

    own = multipliers[2]
    from_clavicle = _minus(to_ac, clavicle.rotate(tuple(girdle.clavicle_conoid_mm)))
    arm = scapula.rotate(tuple(girdle.scapula_conoid_mm))
    conoid = _sum(from_clavicle, arm)
    squared = dot(conoid, conoid)
    shorter = 1.0 / xp.sqrt(squared)
    n = _times(shorter, conoid)
    J = (*clavicle.spin(from_clavicle), *scapula.spin(arm))
    g.append(squared * shorter - conoid_length(theta))
    G.append([dot(column, n) for column in J])
    for i in range(6):
        for j in range(i + 1):
            qq[i][j] = qq[i][j] + own * shorter * (dot(J[i], J[j]) - G[2][i] * G[2][j])
    forces.append(_times(own, n))
    arms.append(arm)

    on_ac = _sum(forces[0], forces[1])
    of_clavicle = _moments([to_ac, from_clavicle], [on_ac, forces[2]])
    of_scapula = _moments(arms, forces)
    for first, turned in ((0, clavicle.curvature(of_clavicle)), (3, scapula.curvature(of_scapula))):
        for (i, j), value in turned.items():
            qq[first + j][first + i] = qq[first + j][first + i] + value
    return ConstraintDerivatives(g, G, T, qq, qu, uu, moved)


def _add_curvature(
    qq: list[list[Array]], qu: list[list[Array]], uu: list[list[Array]], own: Array, J: tuple[Vector, ...], at: Distance
) -> None:
    """Add ``own`` times the second derivatives of the distance; :func:`chain` adds the part of the point's motion."""
    pp: Matrix = tuple(_times(own, row) for row in at.pp)  # type: ignore[assignment]
    pa: Matrix = tuple(_times(own, row) for row in at.pa)  # type: ignore[assignment]
    for i in range(6):
        bent: Vector = tuple(dot(row, J[i]) for row in pp)  # type: ignore[assignment]
        for j in range(i + 1):
            qq[i][j] = qq[i][j] + dot(J[j], bent)  # not +=: all entries start as the same array
        stretched = [J[i][0] * pa[0][k] + J[i][1] * pa[1][k] + J[i][2] * pa[2][k] for k in range(3)]
        for k, value in enumerate(_by_parameter(lambda k, bent=bent: -bent[k], stretched.__getitem__)):
            qu[i][k] = qu[i][k] + value
    for i, row in enumerate(ellipsoid_curvature(at)):
        for j, value in enumerate(row):
            uu[i][j] = uu[i][j] + own * value


def _moments(arms: list[Vector], forces: list[Vector]) -> Matrix:
    """Compute the moment matrix sum r f' of forces f at arms r."""

    def entry(i, j):
        return sum((r[i] * f[j] for r, f in zip(arms[1:], forces[1:], strict=True)), arms[0][i] * forces[0][j])

    return tuple(tuple(entry(i, j) for j in range(3)) for i in range(3))  # type: ignore[return-value]
