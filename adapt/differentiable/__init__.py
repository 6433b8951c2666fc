"""The two fits as differentiable functions of JAX: the closest closed posture, and the girdle adapted to a subject.

The functions are slow, short, and independent of the compiled solvers: they share only the geometry of ``models``. No
derivative goes through an iteration: each is the derivative of an optimum, by the implicit function theorem.
"""

from adapt.differentiable.adapted_subject import WEIGHT, AdaptedSubject, OwnPrior, adapt_subject, objective
from adapt.differentiable.closest_posture import PostureFit, fit_posture

__all__ = ["WEIGHT", "AdaptedSubject", "OwnPrior", "PostureFit", "adapt_subject", "fit_posture", "objective"]
