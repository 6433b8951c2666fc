"""Static balance of clavicle, scapula and arm with the least muscle stress: a convex problem with one solution or none.

Unknowns are the force x_l of each line as a share of its strongest force F_l, and the forces c at TS and AI (which the
thorax can only press) and of the conoid (which can only pull). Moments are taken about GH (three, of the arm), AC
(three, of scapula and arm) and SC (three, of all bones), so that the reactions in these joints drop out. The humerus
presses on the glenoid with F = B x + g, from the muscles that reach the humerus and from the weight of the arm. The
force F has to point within the glenoid's rim, r_k . F >= 0 (``glenoid``; thesis 3.3.2):

    minimise  |x|^2    subject to    A x + C c + w = 0,   x >= 0,   c >= 0,   K x + k >= 0,

A holds the moments of the strongest forces, C of unit contact forces and w of the weights; K = r B, k = r g. Least
squared stress is the criterion of the thesis (3.2.1), as the strongest force of a line is its cross-section times a
stress common to all lines. With the QR factorisation C = [Q1 Q2] [R; 0],

    Q2'(A x + w) = 0,    c = -R^-1 Q1'(A x + w) >= 0:

the first equations balance the moments in the six free directions of chain and arm, where contact does no work; the
second give the contact forces, which are the multipliers of A1-A3. With x = x0 + Z z, where x0 is the shortest solution
of the first equations and Z a basis of their null space, a least-distance problem remains: min |z| with G z >= h.
Lawson and Hanson (Solving Least Squares Problems, 1974, ch. 23) turn this into non-negative least squares: with r the
residual of  [G'; h'] u = (0, 1),  z = -r_1..m / r_m+1; where r = 0 there is no solution.
``scipy.optimize.lsq_linear`` solves the least squares by active sets, and its result is checked. (SciPy's ``nnls``
returns wrong solutions in versions 1.15 to 1.17 at least: scipy/scipy issue 25389; here in 7 % of postures.)

Not included: the weight of clavicle and scapula, the moments that ligaments and capsules bear, and the balance of the
elbow.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Shaped
from threadpoolctl import threadpool_limits

from models.girdle import Girdle, landmarks
from models.muscles.arm_load import ArmLoad
from models.muscles.contact import ContactForces
from models.muscles.glenoid import glenoid_axes, half_angles, off_centre, rim_sides
from models.muscles.muscle_lines import HUMERUS, MuscleLines, published_lines
from models.muscles.pulls import Pulls
from motions.landmarks.frames import humerus_rotation
from motions.rotations import rotate, rotation_from_cardan

OK, BEYOND_STRENGTH, NO_SOLUTION = "ok", "beyond_strength", "no_solution"
BEYOND_RIM, NOT_CONVERGED, INVALID = "beyond_rim", "not_converged", "invalid"

LARGEST_SHARE = 1e4
"""Limit of |x|: a solution beyond it counts as none, since no muscle is so strong and rounding would determine it."""

TOLERANCE = 1e-7
"""Tolerance of the conditions of a solution and of the proof that there is none: shares are of order 0.1, rounding is
1e-13."""


_SOLVER_TOLERANCE = 1e-14
"""Relative decrease of the sum of squares at which ``lsq_linear`` stops, small enough for its active set to be final
first."""


class Balance(NamedTuple):
    """Forces of each posture; NaN where there is no solution."""

    share: Float[np.ndarray, " lines postures"]
    """Force x of each line over its strongest force; above 1 it exceeds the strength of the line."""
    force_N: Float[np.ndarray, " lines postures"]
    contact_N: Float[np.ndarray, " 3 postures"]
    """Forces in the order of ``FORCES``: TS, AI, conoid."""
    gh_N: Float[np.ndarray, " 3 postures"]
    """Force F of the humerus on the glenoid, thorax frame; the reaction in GH is its opposite."""
    off_centre: Float[np.ndarray, " postures"]
    """Direction of F between the glenoid's middle (0) and its rim (1)."""
    multipliers: Float[np.ndarray, " 9 postures"]
    """Multipliers y of A x + C c + w = 0: x = max(A'y + K'v, 0), C'y <= 0."""
    rim_multipliers: Float[np.ndarray, " sides postures"]
    """Multipliers v >= 0 of K x + k >= 0."""
    status: Shaped[np.ndarray, " postures"]
    """``ok``; ``beyond_strength``: a line would need more than its strongest force; ``beyond_rim``: forces of the
    required signs balance the arm, but none with the reaction in GH within the glenoid; ``no_solution``: no forces of
    the required signs balance the arm; ``not_converged``; ``invalid``: a path or an angle, such as the elevation of the
    humerus, is missing."""


def balance(
    lines: MuscleLines,
    found: Pulls,
    contact: ContactForces,
    girdle: Girdle,
    angles: Float[np.ndarray, " 6 postures"],
    humerus: Float[np.ndarray, " 3 postures"],
    load: ArmLoad,
) -> Balance:
    """Compute the balance of every posture (rad), with the weight of arm and load down along the thorax's y-axis.

    ``girdle`` has one element per posture; ``humerus`` is p, e, q.
    """
    F = lines.strongest_force_N
    A = found.about_mm * F[None, :, None]
    C = np.concatenate([np.zeros_like(contact.about_ac_mm), contact.about_ac_mm, contact.about_sc_mm])
    w = load_moments(lines, girdle, angles, humerus, load)
    B = np.where(lines.crosses(HUMERUS)[None, :, None], found.pull * F[None, :, None], 0.0)
    g = np.array([0.0, -load.weight_N.sum(), 0.0])
    document, R_scapula = published_lines(), rotation_from_cardan(angles[3:])
    axes, half = glenoid_axes(document), half_angles(document)
    r = rim_sides(axes, half, R_scapula)
    K, k = np.einsum("kxp,xlp->klp", r, B), np.einsum("kxp,x->kp", r, g)
    with threadpool_limits(1, "blas"):  # on small matrices, more threads would mostly wait for each other
        postures = [least_stress(*(part[..., p] for part in (A, C, w, K, k))) for p in range(w.shape[1])]
    share, c, y, v, status = (np.stack(part, axis=-1) for part in zip(*postures, strict=True))
    pressed = np.einsum("xlp,lp->xp", B, share) + g[:, None]
    return Balance(share, share * F[:, None], c, pressed, off_centre(axes, half, R_scapula, pressed), y, v, status)


def least_stress(
    A: Float[np.ndarray, "moments lines"],
    C: Float[np.ndarray, "moments 3"],
    w: Float[np.ndarray, " moments"],
    K: Float[np.ndarray, "sides lines"],
    k: Float[np.ndarray, " sides"],
):
    """Solve one posture: shares, contact forces, both kinds of multipliers and status (see the module).

    C must have full rank: the three contact forces hold the chain.
    """
    nothing = tuple(np.full(count, np.nan) for count in (A.shape[1], C.shape[1], len(w), len(k)))
    if not all(np.isfinite(part).all() for part in (A, C, w, K, k)):
        return *nothing, INVALID
    *found, status = _within(A, C, w, K, k)
    if status == NO_SOLUTION and len(k) and _within(A, C, w, K[:0], k[:0])[-1] == OK:
        status = BEYOND_RIM
    if status != OK:
        return *nothing, status
    return *found, OK if found[0].max(initial=0.0) <= 1.0 else BEYOND_STRENGTH


def _within(A, C, w, K, k):
    """Solve one posture of finite numbers; the results are valid only where the status is ``ok``."""
    n, held = A.shape[1], C.shape[1]
    Q, R = np.linalg.qr(C, mode="complete")
    to_c = -np.linalg.inv(R[:held]) @ Q[:, :held].T
    size = np.linalg.norm(A, axis=0).max()  # scales all numbers to order 1
    press = max(np.linalg.norm(K, axis=1).max(initial=0.0), 1.0)
    E, e = Q[:, held:].T @ A / size, -Q[:, held:].T @ w / size
    x0, Z = _solutions(E, e)
    rows = np.concatenate([to_c @ A / size, K / press, np.eye(n)])
    limits = np.concatenate([-to_c @ w / size, -k / press, np.zeros(n)])
    if np.abs(E @ x0 - e).max() > TOLERANCE * max(np.abs(e).max(), np.abs(w).max() / size):
        return x0, x0, x0, k, NO_SOLUTION
    z, u, status = _least_distance(rows @ Z, limits - rows @ x0)
    x = x0 + Z @ z
    # Stationarity, x = E' l + rows' u, gives the multipliers of the equations.
    y = (Q[:, held:] @ np.linalg.pinv(E.T) @ (x - rows.T @ u) + to_c.T @ u[:held]) / size
    x = np.maximum(x, 0.0)
    return x, np.maximum(to_c @ (A @ x + w), 0.0), y, u[held : held + len(k)] / press, status


def _solutions(E, e) -> tuple[np.ndarray, np.ndarray]:
    """Compute the shortest x of E x = e (least squares), and an orthonormal basis of the null space of E."""
    U, s, Vt = np.linalg.svd(E, full_matrices=False)
    rank = int(np.sum(s > TOLERANCE * s.max(initial=0.0)))
    Q, _ = np.linalg.qr(Vt[:rank].T, mode="complete")
    return Vt[:rank].T @ ((U[:, :rank].T @ e) / s[:rank]), Q[:, rank:]


def _least_distance(G, h) -> tuple[np.ndarray, np.ndarray, str]:
    """Minimise |z| with G z >= h; return z, the multipliers u >= 0 of z = G' u, and the status."""
    from scipy.optimize import lsq_linear  # takes 0.4 s to load, and few commands need it

    m = G.shape[1]
    target = np.append(np.zeros(m), 1.0)
    u = lsq_linear(np.vstack([G.T, h]), target, (0.0, np.inf), method="bvls", tol=_SOLVER_TOLERANCE).x
    r = np.append(G.T @ u, h @ u) - target
    if np.linalg.norm(r) < 1.0 / LARGEST_SHARE:
        return r[:m], u, NO_SOLUTION  # G'u = 0 and h'u = 1 prove it
    if not r[m] < 0.0:
        return r[:m], u, NOT_CONVERGED
    z, u = -r[:m] / r[m], -u / r[m]
    gap = G @ z - h
    scale = max(float(np.abs(z).max(initial=0.0)), 1.0)
    converged = gap.min() > -TOLERANCE * scale and np.abs(u * gap).max() < TOLERANCE * scale**2
    return z, u, OK if converged else NOT_CONVERGED


def load_moments(
    lines: MuscleLines,
    girdle: Girdle,
    angles: Float[np.ndarray, " 6 postures"],
    humerus: Float[np.ndarray, " 3 postures"],
    load: ArmLoad,
) -> Float[np.ndarray, " 9 postures"]:
    """Compute the moments w of the weights of arm and load about GH, AC and SC, N mm."""
    AC = landmarks(girdle, angles).AC
    GH = AC + rotate(rotation_from_cardan(angles[3:]), _a_posture(lines.gh_mm))
    mean = load.distance @ load.weight_N / max(load.weight_N.sum(), _NO_WEIGHT)
    down_the_arm = -humerus_rotation(humerus)[:, 1]
    centre = GH + mean * upper_arm_mm() * np.asarray(lines.humerus_size) * down_the_arm
    force = np.array([0.0, -load.weight_N.sum(), 0.0])
    return np.concatenate([np.cross(centre - joint, force, axisb=0, axis=0) for joint in (GH, AC, girdle.sc_mm)])


_NO_WEIGHT = 1e-300


def upper_arm_mm() -> float:
    """Compute the length of the cadaver's upper arm, from GH to halfway between the epicondyles."""
    GH, EM, EL = (np.array(published_lines()["cadaver"][f"{name}_mm"]) for name in ("gh", "em", "el"))
    return float(np.linalg.norm(GH - (EM + EL) / 2.0))


def _a_posture(point) -> Float[np.ndarray, " 3 postures"]:
    return np.asarray(point).reshape(3, -1)
