"""The fast path of whole-subject problems on the engine: rounds of more and more iterations."""

import numpy as np

from adapt.engine.batching import as_type, in_rounds
from adapt.engine.kernel import Kernel
from adapt.solvers.batched.posture_kernels import GIRDLE
from adapt.solvers.batched.subject import Fixed, Start, Swept, sweep
from adapt.solvers.reference.subject import Problem, Subject
from models.adapted_parameters import ADAPTED
from motions.arrays import ByType

_CHUNK = 256
"""Subjects in a chunk of a compiled program: 14 postures of each are 30 kB an array."""

_ROUNDS = ByType((10, 10, 20, 20, 400), (10, 10, 20))
"""Most iterations of each round. Measured on simulated subjects, 8 of 10 problems need one round, 199 of 200 four; the
others, one of whose postures is at no strict minimum, converge linearly, which is left to float64."""

_THETA = f"{len(ADAPTED)}"

subjects_kernel = Kernel(
    "subjects",
    sweep,
    (
        Fixed(
            GIRDLE,
            "3 points",
            "points",
            "points",
            Problem("6 postures", "6 postures", "postures bool", _THETA, _THETA),
        ),
        Start(_THETA, "6 postures", "3 postures", "bool"),
        "",
    ),
    Swept(_THETA, "6 postures", "3 postures", "3 postures", "postures", _THETA, "int", "bool"),
    _CHUNK,
)


def sweep_from(fixed: Fixed, theta, angles) -> Subject:
    """Iterate from one start in the type of the measured angles; ``converged`` says where that was enough."""
    problems, postures = theta.shape[-1], angles.shape[1]
    start = Start(theta, angles, np.zeros((3, postures, problems)), np.zeros(problems, bool))
    measured = fixed.problem.measured
    given = as_type(((fixed,), start), measured.dtype)
    swept = as_type(in_rounds(subjects_kernel, _ROUNDS.for_dtype_of(measured), *given), float)
    nothing = np.zeros((postures, problems))
    return Subject(penalty=nothing, radius_mm=nothing[0], **swept._asdict())
