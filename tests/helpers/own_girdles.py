"""Girdle of a person's sizes, and the most probable sizes by CasADi and IPOPT, written anew from the definitions.

Nothing here calls ``models`` or ``adapt``: each size is added to the numbers of the girdle by its meaning. Angles are
in degrees, lengths in mm, sizes in their units (mm, percent of the bone, degrees).
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from oracles import (
    IPOPT_OPTIONS,
    T_SCALE_MM2,
    Bones,
    cardan,
    casadi_cardan,
    constraints,
    ellipsoid_distance,
)

OWN = (
    *("M_y", "M_z", "A_x", "A_y", "A_z", "conoid_length", "SC_x", "SC_y", "SC_z", "clavicle_length", "scapula_size"),
    *("TS_x", "AI_x", "AI_y", "clavicle_conoid_x", "clavicle_conoid_y", "clavicle_conoid_z"),
    *("scapula_conoid_x", "scapula_conoid_y", "scapula_conoid_z", "clavicle_AC_y", "clavicle_AC_z"),
    *("scapula_AC_x", "scapula_AC_y", "scapula_AC_z", "TS_distance", "AI_distance"),
    *("clavicle_frame_x", "clavicle_frame_y", "clavicle_frame_z"),
    *("scapula_frame_x", "scapula_frame_y", "scapula_frame_z"),
)
"""Names of the sizes, in the order of every vector of sizes."""

CORACOID_SHARE = 0.75
"""Growth of the coracoid relative to that of the blade."""


def with_sizes(b: Bones, sizes: Mapping[str, float]) -> Bones:
    """Return the girdle of a person whose sizes differ from those of a set by ``sizes``."""

    def at(name: str) -> float:
        return sizes.get(name, 0.0)

    def place(name: str) -> np.ndarray:
        return np.array([at(f"{name}_x"), at(f"{name}_y"), at(f"{name}_z")])

    def on_bone(vector_mm, larger_percent: float, frame: str) -> np.ndarray:
        """Return a vector of a bone after growth, turned opposite to the axes of the measured frame."""
        return vector_mm + larger_percent / 100.0 * vector_mm + np.cross(np.radians(place(frame)), vector_mm)

    longer, larger, AC = at("clavicle_length"), at("scapula_size"), place("scapula_AC")
    return Bones(
        centre_mm=b.centre_mm + np.array([0.0, at("M_y"), at("M_z")]),
        semi_axes_mm=b.semi_axes_mm + place("A"),
        sc_mm=b.sc_mm + place("SC"),
        ac_mm=on_bone(b.ac_mm, longer, "clavicle_frame") + place("clavicle_AC"),
        clavicle_conoid_mm=on_bone(b.clavicle_conoid_mm, longer, "clavicle_frame") + place("clavicle_conoid"),
        ts_mm=on_bone(b.ts_mm, larger, "scapula_frame") + place("TS") + AC,
        ai_mm=on_bone(b.ai_mm, larger, "scapula_frame") + place("AI") + AC,
        scapula_conoid_mm=on_bone(b.scapula_conoid_mm, CORACOID_SHARE * larger, "scapula_frame")
        + place("scapula_conoid")
        + AC,
        ts_distance_mm=b.ts_distance_mm + at("TS_distance"),
        ai_distance_mm=b.ai_distance_mm + at("AI_distance"),
        conoid_length_mm=b.conoid_length_mm + at("conoid_length"),
    )


def numbers(b: Bones) -> np.ndarray:
    """Return all numbers of a girdle in one vector; they are linear in the sizes."""
    return np.concatenate([np.atleast_1d(x) for x in vars(b).values()])


@dataclass(frozen=True)
class Own:
    """A solution of IPOPT."""

    F: float
    sizes: np.ndarray
    angles_deg: np.ndarray
    success: bool


def own_objective(
    b: Bones, sd, noise_deg: float, target_deg, sizes, angles_deg, weights: Any = 1.0
) -> tuple[float, float]:
    """Compute F = sum of weights (q - s)^2 + noise^2 |z|^2, z = size / SD, and the largest constraint violation, mm."""
    person = with_sizes(b, dict(zip(OWN, sizes, strict=True)))
    gaps = [np.abs(constraints(person, q)[0]).max() for q in angles_deg.T]
    z = np.divide(sizes, sd, out=np.zeros(len(OWN)), where=sd > 0.0)
    return float(np.sum(weights * (angles_deg - target_deg) ** 2) + noise_deg**2 * z @ z), float(max(gaps))


def ipopt_own(b: Bones, sd, noise_deg: float, target_deg, sizes, angles_deg, weights: Any = 1.0) -> Own:
    """Minimise F over all sizes and all postures at once, from (sizes, angles_deg); angles are (6, postures).

    ``weights`` are those of the squared differences of the angles. A size of SD 0 stays. The variables are the angles,
    z and one multiplier t for TS and AI of each posture, with its secular equation as a constraint.
    """
    P, weights = target_deg.shape[1], np.broadcast_to(weights, target_deg.shape)
    z = np.divide(sizes, sd, out=np.zeros(len(OWN)), where=sd > 0.0)
    person = with_sizes(b, dict(zip(OWN, sizes, strict=True)))
    x0 = np.concatenate([angles_deg.T.ravel(), z, _multipliers(person, angles_deg) / T_SCALE_MM2])
    plain = numbers(b)
    columns = np.stack([s * (numbers(with_sizes(b, {name: 1.0})) - plain) for name, s in zip(OWN, sd, strict=True)], 1)
    given = np.concatenate([plain, columns.T.ravel(), target_deg.T.ravel(), weights.T.ravel(), [noise_deg**2]])
    solver = _own_solver(P, len(plain))
    found = solver(x0=x0, p=given, lbg=0.0, ubg=0.0)
    x = np.array(found["x"]).ravel()
    angles, sizes = x[: 6 * P].reshape(P, 6).T, x[6 * P : 6 * P + len(OWN)] * sd
    # This check runs outside CasADi, because a secular equation also has roots that are not the nearest point.
    F, open_mm = own_objective(b, sd, noise_deg, target_deg, sizes, angles, weights)
    same = abs(F - float(found["f"])) <= 1e-7 * (1.0 + abs(F))
    return Own(F, sizes, angles, bool(solver.stats()["success"]) and same and open_mm < 1e-6)


def _multipliers(b: Bones, angles_deg) -> np.ndarray:
    """Compute t for TS and AI of every posture."""
    result = []
    for q in angles_deg.T:
        R_C, R_S = cardan(q[:3])[0], cardan(q[3:])[0]
        AC = b.sc_mm + R_C @ b.ac_mm
        for point in (AC + R_S @ b.ts_mm, AC + R_S @ b.ai_mm):
            d, n = ellipsoid_distance(point - b.centre_mm, b.semi_axes_mm)
            result.append(d / np.linalg.norm((point - b.centre_mm - d * n) / b.semi_axes_mm**2))
    return np.array(result)


@functools.cache
def _own_solver(P: int, count: int) -> Any:
    """Return the solver for persons with P postures; ``count`` is the number of numbers of a girdle."""
    import casadi as ca

    n = len(OWN)
    q, z, t = ca.SX.sym("q", 6, P), ca.SX.sym("z", n), ca.SX.sym("t", 2 * P)
    plain, columns = ca.SX.sym("plain", count), ca.SX.sym("columns", count, n)
    target, weights, variance = ca.SX.sym("target", 6, P), ca.SX.sym("weights", 6, P), ca.SX.sym("variance")
    x = plain + columns @ z
    centre, axes, sc, ac, clavicle_conoid, ts, ai, scapula_conoid = (x[3 * k : 3 * k + 3] for k in range(8))
    ts_distance, ai_distance, conoid_length = (x[24 + k] for k in range(3))
    equations = []

    def distance(point, multiplier):
        normal = (point - centre) / (multiplier * T_SCALE_MM2 + axes**2)
        equations.append(ca.sumsqr(axes * normal) - 1.0)
        return multiplier * T_SCALE_MM2 * ca.norm_2(normal)

    for k in range(P):
        R_C, R_S = casadi_cardan(ca, q[:3, k]), casadi_cardan(ca, q[3:, k])
        AC = sc + R_C @ ac
        equations.append(distance(AC + R_S @ ts, t[2 * k]) - ts_distance)
        equations.append(distance(AC + R_S @ ai, t[2 * k + 1]) - ai_distance)
        equations.append(ca.norm_2(AC + R_S @ scapula_conoid - sc - R_C @ clavicle_conoid) - conoid_length)
    problem = {
        "x": ca.vertcat(ca.vec(q), z, t),
        "p": ca.vertcat(plain, ca.vec(columns), ca.vec(target), ca.vec(weights), variance),
        "f": ca.sum(ca.vec(weights * (q - target) ** 2)) + variance * ca.sumsqr(z),
        "g": ca.vertcat(*equations),
    }
    return ca.nlpsol("person", "ipopt", problem, {"print_time": False, "ipopt": IPOPT_OPTIONS})
