"""Adaptations of the chain without effects on the engine, in rounds of more and more iterations."""

from typing import Any

import numpy as np

from adapt.engine.batching import as_type, in_rounds
from adapt.engine.kernel import Kernel
from adapt.solvers.newton.postures import GIRDLE
from adapt.solvers.newton.subject import SubjectProblem, iterate
from adapt.solvers.solution import SubjectSolution
from models.adapted_parameters import ADAPTED
from motions.arrays import ByType

_CHUNK = 256
"""Number of subjects per chunk of a compiled program: with 14 postures each an array has 30 kB."""

_ROUNDS = ByType((10, 10, 20, 20, 400), (10, 10, 20))
"""Largest numbers of iterations, per round. On simulated subjects 8 of 10 problems need one round, 199 of 200 four; the
others have a posture at no strict minimum and converge linearly, which is left to float64."""

_THETA = f"{len(ADAPTED)}"

_PROBLEM: Any = SubjectProblem(
    GIRDLE, *("3 points", "points", "points"), *("6 postures", "6 postures", "postures bool", _THETA, _THETA)
)  # type: ignore[arg-type]

_SOLUTION: Any = SubjectSolution(
    *(_THETA, "6 postures", "3 postures", "3 postures", "postures", _THETA, "int", "int")  # type: ignore[arg-type]
)

subjects_kernel = Kernel(
    "subjects", iterate, (_PROBLEM, (_THETA, "6 postures", "3 postures", "bool"), ""), _SOLUTION, _CHUNK
)


def fit_subjects(problem: SubjectProblem, theta, angles) -> SubjectSolution:
    """Iterate from one start in the type of the measured angles; check ``converged``."""
    multipliers = np.zeros((3, *angles.shape[1:]))
    given = as_type(((problem,), (theta, angles, multipliers)), problem.angles.dtype)
    rounds = _ROUNDS.for_dtype_of(problem.angles)
    return as_type(in_rounds(subjects_kernel, rounds, given[0], ("theta", "angles", "multipliers"), *given[1]), float)
