"""CasADi's generated C, compiled with -O3 -march=native, with IPOPT and with Fatrop; threaded map over the subjects.

Fair: exact derivatives, sparse; nothing is interpreted. IPOPT factorises with MUMPS, which runs in one thread at a
time. Fatrop is an interior-point method for problems in stages: the postures are its stages, theta is the state that
each stage passes on unchanged, so its Riccati recursion eliminates posture after posture as ours does. It relaxes
bounds by 1e-8 of their size, which lowers E by some 1e-9 of it. CasADi's own SQP does not converge here: with its
``regularize`` for no subject within 60 iterations; without convexification it was stopped after ten minutes.
"""

import functools
import os
import shutil
from typing import Any

import numpy as np
from oracles import (  # pyright: ignore[reportMissingImports]
    IPOPT_OPTIONS,
    T_SCALE_MM2,
    WEIGHT,
    casadi_cardan,
    fixed_numbers,
    foot_point_multipliers,
    ipopt_call,
    subject_problem,
)

from scripts.research.speed.peers.cases import Answer, Cases, cases
from scripts.research.speed.peers.shares import Share, timed_share

COMPILER = shutil.which("gcc") or shutil.which("clang")
"""C compiler of this machine, or None."""

_STAGE = 14
"""Variables of one stage of Fatrop: theta, six angles, t of TS and AI."""


def run_ipopt(model: str, count: int, total: int) -> Share:
    """Compute E of the first ``count`` subjects by IPOPT."""
    given = cases(model, count, total)
    postures, points = given.targets_deg[0].shape[1], given.points_mm.shape[1]
    solver = _compiled("ipopt", postures, points)
    calls = [
        ipopt_call(given.bones, given.points_mm, target, given.theta_mm, target, given.bounds_mm)[1]
        for target in given.targets_deg
    ]

    def answer(x: np.ndarray) -> Answer:
        return x[6 * postures : 6 * postures + 6], x[: 6 * postures].reshape(postures, 6).T

    return timed_share(given, lambda: [answer(x) for x in _mapped(solver, calls)])


def run_fatrop(model: str, count: int, total: int) -> Share:
    """Compute E of the first ``count`` subjects by Fatrop."""
    given = cases(model, count, total)
    postures, points = given.targets_deg[0].shape[1], given.points_mm.shape[1]
    solver = _compiled("fatrop", postures, points)
    calls = [fatrop_call(given, target) for target in given.targets_deg]

    def answer(x: np.ndarray) -> Answer:
        stages = x[: _STAGE * postures].reshape(postures, _STAGE)
        return stages[0, :6], stages[:, 6:12].T

    return timed_share(given, lambda: [answer(x) for x in _mapped(solver, calls)])


def _mapped(solver: Any, calls: list[dict[str, Any]]) -> np.ndarray:
    """Solve all calls in as many threads as there are cores; return x of each."""
    every = {key: np.column_stack([call[key] for call in calls]) for key in ("x0", "p", "lbx", "ubx")}
    found = solver.map(len(calls), "thread", os.cpu_count() or 1)(**every, lbg=0.0, ubg=0.0)
    return np.array(found["x"]).T


@functools.cache
def _compiled(solver: str, postures: int, points: int) -> Any:
    """Build the solver with its functions compiled to machine code, which takes most of a minute."""
    import casadi as ca

    flags = {"compiler": COMPILER, "flags": ["-O3", "-march=native"]}
    options = {"jit": True, "compiler": "shell", "jit_options": flags, "print_time": False}
    if solver == "ipopt":
        return ca.nlpsol("ipopt", "ipopt", subject_problem(postures, points), options | {"ipopt": IPOPT_OPTIONS})
    problem, stages = in_stages(postures, points)
    fatrop = {"print_level": 0, "tol": 1e-10, "max_iter": 500}
    return ca.nlpsol("fatrop", "fatrop", problem, options | stages | {"fatrop": fatrop})


def in_stages(P: int, N: int) -> tuple[dict[str, Any], dict[str, Any]]:
    """Build ``oracles.subject_problem`` in stages, with copies of theta for every posture and for the thorax points.

    Returns the problem and the options that describe its stages.
    """
    import casadi as ca

    fixed, points, target = ca.SX.sym("fixed", 21), ca.SX.sym("points", 3, N), ca.SX.sym("target", 6, P)
    sc, ac, cc, ts, ai, sconoid = (fixed[3 * k : 3 * k + 3] for k in range(6))
    theta = ca.SX.sym("theta", 6, P + 1)
    variables, equations, J = [], [], 0.0

    def distance(point, own, t):
        n = (point - ca.vertcat(fixed[18], own[:2])) / (t * T_SCALE_MM2 + own[2:5] ** 2)
        equations.append(ca.sumsqr(own[2:5] * n) - 1.0)
        return t * T_SCALE_MM2 * ca.norm_2(n)

    for k in range(P):
        own, q, t = theta[:, k], ca.SX.sym("q", 6), ca.SX.sym("t", 2)
        variables += [own, q, t]
        equations.append(theta[:, k + 1] - own)
        R_C, R_S = casadi_cardan(ca, q[:3]), casadi_cardan(ca, q[3:])
        AC = sc + R_C @ ac
        equations.append(distance(AC + R_S @ ts, own, t[0]) - fixed[19])
        equations.append(distance(AC + R_S @ ai, own, t[1]) - fixed[20])
        equations.append(ca.norm_2(AC + R_S @ sconoid - sc - R_C @ cc) - own[5])
        J += ca.sumsqr(q - target[:, k]) / (6 * P)
    t = ca.SX.sym("t", N)
    D = sum(distance(points[:, k], theta[:, P], t[k]) ** 2 for k in range(N)) / N
    problem = {
        "x": ca.vertcat(*variables, theta[:, P], t),
        "p": ca.vertcat(fixed, ca.vec(points), ca.vec(target)),
        "f": D + WEIGHT * J,
        "g": ca.vertcat(*equations),
    }
    stages = {"structure_detection": "manual", "N": P, "nx": [6] * (P + 1), "nu": [8] * P + [N], "ng": [5] * P + [N]}
    return problem, stages | {"equality": [True] * problem["g"].numel()}


def fatrop_call(given: Cases, target: np.ndarray) -> dict[str, Any]:
    """Return the arguments of Fatrop for one subject."""
    P = target.shape[1]
    t = foot_point_multipliers(given.bones, given.points_mm, given.theta_mm, target) / T_SCALE_MM2
    theta = np.broadcast_to(given.theta_mm, (P, 6))
    x0 = np.concatenate([np.hstack([theta, target.T, t[: 2 * P].reshape(P, 2)]).ravel(), given.theta_mm, t[2 * P :]])
    lower, upper = np.full((2, len(x0)), [[-np.inf], [np.inf]])
    lower[:6], upper[:6] = given.bounds_mm
    p = np.concatenate([fixed_numbers(given.bones), given.points_mm.T.ravel(), target.T.ravel()])
    return {"x0": x0, "p": p, "lbx": lower, "ubx": upper}
