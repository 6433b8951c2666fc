"""Independent solvers: SciPy's SLSQP for one posture, CasADi and IPOPT for a whole subject.

Nothing here calls ``models.girdle``, ``models.ellipsoid`` or ``adapt``: rotations, landmarks, distances and derivatives
are written anew, in NumPy and in CasADi. Angles are in degrees, lengths in mm.
"""

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize

WEIGHT = 10.0
"""w of Eq. 6.5."""

_RTOL: Any = 1e-15
"""Smallest relative tolerance that SciPy's Brent method accepts: 4 rounding errors."""

_LENGTHS = ("ts_distance_mm", "ai_distance_mm", "conoid_length_mm")
_K = np.array([np.cross(np.eye(3)[k], np.eye(3)).T for k in (1, 2, 0)])
"""Generators of the rotations about y, z and x: K v = e x v."""

_K_SQUARED = _K @ _K


@dataclass(frozen=True)
class Bones:
    """A girdle as NumPy arrays; the fields have the names of ``models.girdle.Girdle``."""

    centre_mm: np.ndarray
    semi_axes_mm: np.ndarray
    sc_mm: np.ndarray
    ac_mm: np.ndarray
    clavicle_conoid_mm: np.ndarray
    ts_mm: np.ndarray
    ai_mm: np.ndarray
    scapula_conoid_mm: np.ndarray
    ts_distance_mm: float
    ai_distance_mm: float
    conoid_length_mm: float


def bones(girdle, problem: int | None = None) -> Bones:
    """Return the numbers of an unbatched girdle, or of problem ``problem`` of a batch."""
    values: dict[str, Any] = {k: np.asarray(v if problem is None else v[..., problem]) for k, v in vars(girdle).items()}
    for k in _LENGTHS:
        values[k] = float(values[k])
    return Bones(**values)


def shortest_conoid_mm(girdle) -> float:
    """Compute ||u| - |v||, the shortest distance between the attachments of the conoid in any posture.

    u runs from the clavicular attachment to AC, v from AC to the scapular attachment. A chain with a conoid shorter
    than this, or longer than |u| + |v|, closes in no posture (A3).
    """
    u = np.asarray(girdle.ac_mm - girdle.clavicle_conoid_mm)
    v = np.asarray(girdle.scapula_conoid_mm)
    return float(abs(np.linalg.norm(u) - np.linalg.norm(v)))


def cardan(angles_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute R = Ry Rz Rx, each exp(angle K), and its three derivatives per degree."""
    angles = np.radians(angles_deg)[:, None, None]
    Ry, Rz, Rx = np.eye(3) + np.sin(angles) * _K + (1.0 - np.cos(angles)) * _K_SQUARED
    Ky, Kz, Kx = _K
    ZX = Rz @ Rx
    R = Ry @ ZX
    return R, np.radians(np.stack([Ky @ R, Ry @ Kz @ ZX, R @ Kx]))


def ellipsoid_distance(p: np.ndarray, axes: np.ndarray) -> tuple[float, np.ndarray]:
    """Compute the signed distance to the surface for a point relative to the centre, and the normal at the foot point.

    Brent's method finds the largest t with sum (a_i p_i / (t + a_i^2))^2 = 1.
    """
    terms = [(abs(a * x), a * a) for a, x in zip(axes.tolist(), p.tolist(), strict=True)]
    (x, xx), (y, yy), (z, zz) = terms

    def secular(t: float) -> float:
        return (x / (t + xx)) ** 2 + (y / (t + yy)) ** 2 + (z / (t + zz)) ** 2 - 1.0

    low = max(ap - a2 for ap, a2 in terms)
    high = np.sqrt(sum(ap * ap for ap, _ in terms)) - min(a2 for _, a2 in terms)
    t: Any = high
    if secular(high) < 0.0:  # otherwise ``high`` is the root to rounding, as for a sphere
        t = brentq(secular, low, high, xtol=1e-14, rtol=_RTOL) if secular(low) > 0.0 else low
    n = p / (t + axes * axes)
    length = np.linalg.norm(n)
    return float(t * length), n / length


def constraints(b: Bones, q_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute A1-A3 in mm and their derivatives in mm per degree."""
    R_C, dR_C = cardan(q_deg[:3])
    R_S, dR_S = cardan(q_deg[3:])
    AC, dAC = b.sc_mm + R_C @ b.ac_mm, dR_C @ b.ac_mm
    g, G = np.empty(3), np.empty((3, 6))
    for row, (point, distance) in enumerate(((b.ts_mm, b.ts_distance_mm), (b.ai_mm, b.ai_distance_mm))):
        d, n = ellipsoid_distance(AC + R_S @ point - b.centre_mm, b.semi_axes_mm)
        g[row], G[row] = d - distance, np.concatenate([dAC @ n, (dR_S @ point) @ n])
    conoid = AC + R_S @ b.scapula_conoid_mm - b.sc_mm - R_C @ b.clavicle_conoid_mm
    length = np.linalg.norm(conoid)
    along = np.concatenate([dAC - dR_C @ b.clavicle_conoid_mm, dR_S @ b.scapula_conoid_mm]) @ conoid
    g[2], G[2] = length - b.conoid_length_mm, along / length
    return g, G


@dataclass(frozen=True)
class Posture:
    """A solution of SLSQP."""

    angles_deg: np.ndarray
    j_deg2: float
    open_mm: float
    success: bool


def slsqp(b: Bones, target_deg: np.ndarray, start_deg: np.ndarray, measured: np.ndarray | None = None) -> Posture:
    """Find the closest closed posture near ``start_deg`` by SciPy's SLSQP, with analytic derivatives."""
    share = np.ones(6) if measured is None else measured.astype(float)
    share = share / share.sum()
    target = np.where(share > 0.0, target_deg, 0.0)
    remembered: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def both(q):
        key = q.tobytes()
        if key not in remembered:
            remembered[key] = constraints(b, q)
        return remembered[key]

    found = minimize(
        lambda q: float(share @ (q - target) ** 2),
        start_deg,
        jac=lambda q: 2.0 * share * (q - target),
        constraints={"type": "eq", "fun": lambda q: both(q)[0], "jac": lambda q: both(q)[1]},
        method="SLSQP",
        options={"ftol": 1e-10, "maxiter": 200},
    )
    open_mm = float(np.abs(constraints(b, found.x)[0]).max())
    return Posture(found.x, float(share @ (found.x - target) ** 2), open_mm, bool(found.success))


def kkt_residual(b: Bones, target_deg, q_deg, multipliers, measured: np.ndarray | None = None) -> float:
    """Compute max |dJ/dq + G' lambda|, with q in degrees, J in deg^2 and lambda in deg^2 per mm."""
    share = np.ones(6) if measured is None else measured.astype(float)
    share = share / share.sum()
    gap = np.where(share > 0.0, q_deg - np.where(share > 0.0, target_deg, 0.0), 0.0)
    _, G = constraints(b, q_deg)
    return float(np.abs(2.0 * share * gap + G.T @ multipliers).max())


@dataclass(frozen=True)
class Subject:
    """A solution of IPOPT."""

    E: float
    theta_mm: np.ndarray
    angles_deg: np.ndarray
    success: bool


T_SCALE_MM2 = 1e4
"""Scale of the foot point multipliers t (distance times semi-axis), so that the variables of IPOPT are of size 1."""


IPOPT_OPTIONS = {"print_level": 0, "sb": "yes", "tol": 1e-10, "max_iter": 500, "bound_relax_factor": 0.0}


def ipopt(
    b: Bones,
    points_mm: np.ndarray,
    target_deg: np.ndarray,
    theta_mm: np.ndarray,
    angles_deg: np.ndarray,
    bounds_mm: np.ndarray,
    measured: np.ndarray | None = None,
) -> Subject:
    """Minimise D + w mean(J_p) over theta and all postures at once, from (theta_mm, angles_deg).

    ``target_deg`` and ``angles_deg`` have shape (6, postures). The variables are the angles, theta and one multiplier t
    for each TS, AI and thorax point, with its secular equation as a constraint.
    """
    P = target_deg.shape[1]
    solver, arguments = ipopt_call(b, points_mm, target_deg, theta_mm, angles_deg, bounds_mm, measured)
    found = solver(**arguments)
    x = np.array(found["x"]).ravel()
    angles, theta = x[: 6 * P].reshape(P, 6).T, x[6 * P : 6 * P + 6]
    # This check runs outside CasADi, because a secular equation also has roots that are not the nearest point.
    E, open_mm = whole_objective(b, points_mm, target_deg, theta, angles, measured)
    same = abs(E - float(found["f"])) <= 1e-7 * (1.0 + abs(E))
    return Subject(E, theta, angles, bool(solver.stats()["success"]) and same and open_mm < 1e-6)


def ipopt_call(
    b: Bones, points_mm, target_deg, theta_mm, angles_deg, bounds_mm, measured: np.ndarray | None = None
) -> tuple[Any, dict[str, Any]]:
    """Return the solver of :func:`ipopt` and the arguments of its one call."""
    P, N = target_deg.shape[1], points_mm.shape[1]
    start_t = foot_point_multipliers(b, points_mm, theta_mm, angles_deg)
    x0 = np.concatenate([angles_deg.T.ravel(), theta_mm, start_t / T_SCALE_MM2])
    lower, upper = np.full((2, len(x0)), [[-np.inf], [np.inf]])
    lower[6 * P : 6 * P + 6], upper[6 * P : 6 * P + 6] = bounds_mm
    parameters = np.concatenate([fixed_numbers(b), points_mm.T.ravel(), target_deg.T.ravel()])
    known = None if measured is None else tuple(map(tuple, measured.tolist()))
    return _whole_subject(P, N, known), {"x0": x0, "p": parameters, "lbx": lower, "ubx": upper, "lbg": 0.0, "ubg": 0.0}


def with_theta(b: Bones, theta: np.ndarray) -> Bones:
    """Return the girdle with other adapted parameters M_y, M_z, A_x, A_y, A_z, conoid length."""
    moved = {"centre_mm": np.array([b.centre_mm[0], *theta[:2]]), "semi_axes_mm": theta[2:5]}
    return Bones(**{**vars(b), **moved, "conoid_length_mm": float(theta[5])})


def shares(P: int, measured: Any = None) -> np.ndarray:
    """Return the weight of the square of each angle in mean J, with shape (6, postures)."""
    known = np.ones((6, P)) if measured is None else np.array(measured, float)
    return known / known.sum(axis=0) / P


def whole_objective(b: Bones, points_mm, target_deg, theta, angles_deg, measured=None) -> tuple[float, float]:
    """Compute E at given parameters and postures, and the largest constraint violation in mm."""
    moved = with_theta(b, theta)
    D = np.mean([ellipsoid_distance(p - moved.centre_mm, moved.semi_axes_mm)[0] ** 2 for p in points_mm.T])
    gaps = [np.abs(constraints(moved, q)[0]).max() for q in angles_deg.T]
    J = np.sum(shares(target_deg.shape[1], measured) * (angles_deg - target_deg) ** 2)
    return float(D + WEIGHT * J), float(max(gaps))


def fixed_numbers(b: Bones) -> np.ndarray:
    """Return the numbers that no variable changes, as parameters of the CasADi problem."""
    vectors = (b.sc_mm, b.ac_mm, b.clavicle_conoid_mm, b.ts_mm, b.ai_mm, b.scapula_conoid_mm)
    return np.concatenate([*vectors, [b.centre_mm[0], b.ts_distance_mm, b.ai_distance_mm]])


def foot_point_multipliers(b: Bones, points_mm, theta, angles_deg) -> np.ndarray:
    """Compute t for TS and AI of every posture, then for the thorax points."""
    moved = with_theta(b, theta)
    on_bones = []
    for q in angles_deg.T:
        R_C, R_S = cardan(q[:3])[0], cardan(q[3:])[0]
        AC = b.sc_mm + R_C @ b.ac_mm
        on_bones += [AC + R_S @ b.ts_mm, AC + R_S @ b.ai_mm]
    a = moved.semi_axes_mm
    result = []
    for point in (*on_bones, *points_mm.T):
        p = point - moved.centre_mm
        d, n = ellipsoid_distance(p, a)
        x = p - d * n
        result.append(d / np.linalg.norm(x / a**2))
    return np.array(result)


@functools.cache
def _whole_subject(P: int, N: int, measured: Any) -> Any:
    """Return the IPOPT solver of a subject with P postures and N thorax points."""
    import casadi as ca

    return ca.nlpsol("subject", "ipopt", subject_problem(P, N, measured), {"print_time": False, "ipopt": IPOPT_OPTIONS})


def subject_problem(P: int, N: int, measured: Any = None) -> dict[str, Any]:
    """Build the problem of a subject with P postures and N thorax points in CasADi's symbols."""
    import casadi as ca

    q, theta, t = ca.SX.sym("q", 6, P), ca.SX.sym("theta", 6), ca.SX.sym("t", 2 * P + N)
    fixed, points, target = ca.SX.sym("fixed", 21), ca.SX.sym("points", 3, N), ca.SX.sym("target", 6, P)
    sc, ac, cc, ts, ai, sconoid = (fixed[3 * k : 3 * k + 3] for k in range(6))
    centre, axes = ca.vertcat(fixed[18], theta[0], theta[1]), theta[2:5]
    equations = []

    def distance(point, multiplier):
        n = (point - centre) / (multiplier * T_SCALE_MM2 + axes**2)
        equations.append(ca.sumsqr(axes * n) - 1.0)
        return multiplier * T_SCALE_MM2 * ca.norm_2(n)

    for k in range(P):
        R_C, R_S = casadi_cardan(ca, q[:3, k]), casadi_cardan(ca, q[3:, k])
        AC = sc + R_C @ ac
        equations.append(distance(AC + R_S @ ts, t[2 * k]) - fixed[19])
        equations.append(distance(AC + R_S @ ai, t[2 * k + 1]) - fixed[20])
        equations.append(ca.norm_2(AC + R_S @ sconoid - sc - R_C @ cc) - theta[5])
    D = sum(distance(points[:, k], t[2 * P + k]) ** 2 for k in range(N)) / N
    return {
        "x": ca.vertcat(ca.vec(q), theta, t),
        "p": ca.vertcat(fixed, ca.vec(points), ca.vec(target)),
        "f": D + WEIGHT * ca.sum(ca.vec(ca.DM(shares(P, measured)) * (q - target) ** 2)),
        "g": ca.vertcat(*equations),
    }


def casadi_cardan(ca, angles_deg):
    """Build R = Ry Rz Rx in CasADi's symbols."""
    a, b, c = (angles_deg[k] * np.pi / 180.0 for k in range(3))
    Ry = ca.vertcat(ca.horzcat(ca.cos(a), 0, ca.sin(a)), ca.DM([[0, 1, 0]]), ca.horzcat(-ca.sin(a), 0, ca.cos(a)))
    Rz = ca.vertcat(ca.horzcat(ca.cos(b), -ca.sin(b), 0), ca.horzcat(ca.sin(b), ca.cos(b), 0), ca.DM([[0, 0, 1]]))
    Rx = ca.vertcat(ca.DM([[1, 0, 0]]), ca.horzcat(0, ca.cos(c), -ca.sin(c)), ca.horzcat(0, ca.sin(c), ca.cos(c)))
    return Ry @ Rz @ Rx
