"""The two fits as differentiable functions of JAX: the closest closed posture, and the girdle adapted to a subject.

Slow, short, and independent of the compiled solvers: it shares the geometry of ``models`` with them and nothing else.
No derivative goes through an iteration: each is that of an optimum, by the implicit function theorem.
"""

from adapt.differentiable.adapted_subject import WEIGHT, AdaptedSubject, OwnPrior, adapt_subject, objective
from adapt.differentiable.closest_posture import PostureFit, fit_posture

__all__ = ["WEIGHT", "AdaptedSubject", "OwnPrior", "PostureFit", "adapt_subject", "fit_posture", "objective"]
