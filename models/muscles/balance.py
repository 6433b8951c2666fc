"""Static balance of clavicle and scapula with the least muscle stress: a convex problem with one solution or none.

Unknown: the force x_l of each line as a share of its strongest force F_l, and the forces c of TS and AI (which the
thorax can only press) and of the conoid (which can only pull). The reactions in SC and AC drop out of the moments about
them, three of the scapula about AC and three of clavicle and scapula about SC:

    minimise  |x|^2    subject to    A x + C c + w = 0,   x >= 0,   c >= 0,

A: moments of the strongest forces, C: of unit contact forces, w: of the arm's weight. Least squared stress is the
criterion of the thesis (3.2.1), as a strongest force is cross-section times one stress. With C = [Q1 Q2] [R; 0],

    Q2'(A x + w) = 0,    c = -R^-1 Q1'(A x + w) >= 0:

the first are the moments in the three free directions of the chain, where contact does no work; the second are its
multipliers. With x = x0 + Z z, x0 the shortest solution of the equations and Z normal to them, the rest is a
least-distance problem, min |z| with G z >= h, which Lawson and Hanson (Solving Least Squares Problems, 1974, ch. 23)
turn into non-negative least squares: with r the residual of  [G'; h'] u = (0, 1),  z = -r_1..m / r_m+1; where r = 0
there is no solution. ``scipy.optimize.lsq_linear`` solves it by active sets, and what it returns is checked. (SciPy's
``nnls`` returns wrong solutions in versions 1.15 to 1.17 at least: scipy/scipy issue 25389; here in 7 % of postures.)

The arm's own muscles are not in it: its weight acts in GH as a force, without the moment that they pass to the scapula.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Shaped

from models.girdle import Girdle, landmarks
from models.muscles.contact import FORCES, ContactForces
from models.muscles.muscle_lines import MuscleLines
from models.muscles.pulls import Pulls
from motions.rotations import rotate, rotation_from_cardan

OK, BEYOND_STRENGTH, NO_SOLUTION = "ok", "beyond_strength", "no_solution"
NOT_CONVERGED, INVALID = "not_converged", "invalid"

GRAVITY_M_S2 = 9.81

ARM_SHARE = 0.05
"""Mass of a whole arm, of the body's: upper arm 0.028, forearm and hand 0.022 (D.A. Winter, Biomechanics and Motor
Control of Human Movement, 4th ed. 2009, Table 4.1, after Dempster 1955)."""

LARGEST_SHARE = 1e4
"""A solution whose |x| were beyond it is none: no muscle has it, and rounding would decide."""

TOLERANCE = 1e-7
"""Of the conditions of a solution, and of the proof that there is none: shares are of order 0.1, rounding is 1e-13."""


_SOLVER_TOLERANCE = 1e-14
"""Relative fall of the squares at which ``lsq_linear`` stops: never before its active set is final."""


class Balance(NamedTuple):
    """Forces of each posture; NaN where there are none."""

    share: Float[np.ndarray, " lines postures"]
    """x: force of each line over its strongest force; above 1 is beyond its strength."""
    force_N: Float[np.ndarray, " lines postures"]
    contact_N: Float[np.ndarray, " 3 postures"]
    """Of FORCES: TS, AI, conoid."""
    multipliers: Float[np.ndarray, " 6 postures"]
    """y of A x + C c + w = 0: x = max(A'y, 0), C'y <= 0."""
    status: Shaped[np.ndarray, " postures"]
    """``ok``; ``beyond_strength``: a line would need more than its strongest force; ``no_solution``: no forces of these
    signs balance the arm; ``not_converged``; ``invalid``: a path or an angle is missing."""


def arm_weight_N(body_mass_kg: float) -> float:
    """Compute the weight of one arm, N."""
    return ARM_SHARE * body_mass_kg * GRAVITY_M_S2


def balance(
    lines: MuscleLines,
    found: Pulls,
    contact: ContactForces,
    girdle: Girdle,
    angles: Float[np.ndarray, " 6 postures"],
    weight_N: float,
) -> Balance:
    """Balance the arm's weight, down along the thorax's y-axis, in every posture (rad); girdle: one a posture."""
    scale = lines.strongest_force_N[None, :, None]
    A = np.concatenate([found.about_ac_mm * scale, found.about_sc_mm * scale])
    C = np.concatenate([contact.about_ac_mm, contact.about_sc_mm])
    w = _weight_moments(lines, girdle, angles, weight_N)
    postures = [least_stress(A[..., p], C[..., p], w[:, p]) for p in range(w.shape[1])]
    share, c, multipliers, status = (np.stack(part, axis=-1) for part in zip(*postures, strict=True))
    return Balance(share, share * lines.strongest_force_N[:, None], c, multipliers, status)


def least_stress(A: Float[np.ndarray, "6 lines"], C: Float[np.ndarray, "6 3"], w: Float[np.ndarray, "6"]):
    """Solve one posture: shares, contact forces, multipliers and status (see the module).

    C must have full rank: three forces that hold the chain.
    """
    n = A.shape[1]
    nothing = np.full(n, np.nan), np.full(len(FORCES), np.nan), np.full(6, np.nan)
    if not all(np.isfinite(part).all() for part in (A, C, w)):
        return *nothing, INVALID
    Q, R = np.linalg.qr(C, mode="complete")
    to_c = -np.linalg.inv(R[:3]) @ Q[:, :3].T
    size = np.linalg.norm(A, axis=0).max()  # so that all numbers are of order 1
    E, e = Q[:, 3:].T @ A / size, -Q[:, 3:].T @ w / size
    x0, Z = _solutions(E, e)
    if np.abs(E @ x0 - e).max() > TOLERANCE * max(np.abs(e).max(), np.abs(w).max() / size):
        return *nothing, NO_SOLUTION
    rows, limits = np.concatenate([to_c @ A / size, np.eye(n)]), np.concatenate([-to_c @ w / size, np.zeros(n)])
    z, u, status = _least_distance(rows @ Z, limits - rows @ x0)
    if status != OK:
        return *nothing, status
    x = x0 + Z @ z
    # Stationarity, x = E' l + rows' u, gives the multipliers of the equations.
    y = (Q[:, 3:] @ np.linalg.pinv(E.T) @ (x - rows.T @ u) + to_c.T @ u[:3]) / size
    x, c = np.maximum(x, 0.0), np.maximum(to_c @ (A @ x + w), 0.0)
    return x, c, y, OK if x.max(initial=0.0) <= 1.0 else BEYOND_STRENGTH


def _solutions(E, e) -> tuple[np.ndarray, np.ndarray]:
    """Compute the shortest x of E x = e (least squares), and an orthonormal basis of what E leaves open."""
    U, s, Vt = np.linalg.svd(E)
    rank = int(np.sum(s > TOLERANCE * s.max(initial=0.0)))
    return Vt[:rank].T @ ((U[:, :rank].T @ e) / s[:rank]), Vt[rank:].T


def _least_distance(G, h) -> tuple[np.ndarray, np.ndarray, str]:
    """Minimise |z| with G z >= h: z, the multipliers u >= 0 of z = G' u, and how it ended."""
    from scipy.optimize import lsq_linear  # 0.4 s to load: not for every command

    m = G.shape[1]
    target = np.append(np.zeros(m), 1.0)
    u = lsq_linear(np.vstack([G.T, h]), target, (0.0, np.inf), method="bvls", tol=_SOLVER_TOLERANCE).x
    r = np.append(G.T @ u, h @ u) - target
    if np.linalg.norm(r) < 1.0 / LARGEST_SHARE:
        return r[:m], u, NO_SOLUTION  # G'u = 0, h'u = 1: proved
    if not r[m] < 0.0:
        return r[:m], u, NOT_CONVERGED
    z, u = -r[:m] / r[m], -u / r[m]
    gap = G @ z - h
    scale = max(float(np.abs(z).max(initial=0.0)), 1.0)
    converged = gap.min() > -TOLERANCE * scale and np.abs(u * gap).max() < TOLERANCE * scale**2
    return z, u, OK if converged else NOT_CONVERGED


def _weight_moments(lines: MuscleLines, girdle: Girdle, angles, weight_N: float) -> Float[np.ndarray, " 6 postures"]:
    at = landmarks(girdle, angles)
    arm = rotate(rotation_from_cardan(angles[3:]), lines.gh_mm.reshape(3, -1))
    force = np.broadcast_to(np.array([0.0, -weight_N, 0.0])[:, None], arm.shape)
    return np.concatenate([np.cross(arm, force, axis=0), np.cross(at.AC + arm - girdle.sc_mm, force, axis=0)])
