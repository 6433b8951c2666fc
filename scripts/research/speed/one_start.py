"""Adaptations from a single start, as for the solvers that they are compared with."""

import numpy as np

from adapt.solvers.adaptation import solved_from
from adapt.solvers.objective import WEIGHT
from adapt.solvers.problems import Problems, subject_problem
from adapt.solvers.solution import SubjectSolution
from models.effects import NO_ACTIVE_EFFECTS


def solved_from_geometric_fit(data: Problems) -> SubjectSolution:
    """Solve from the geometric fit and the measured angles, with the default weight."""
    theta = np.clip(data.girdle.adapted_mm, *data.bounds_mm)
    problem = subject_problem(data, np.full(data.counted.shape[1:], WEIGHT))
    return solved_from(problem, NO_ACTIVE_EFFECTS, theta, data.angles)
