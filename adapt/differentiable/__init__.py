"""The two fits as differentiable functions of JAX: the closest closed posture, and the girdle adapted to a subject.

Slow, short, and independent of the compiled solvers: it shares the geometry of ``models`` with them and nothing else.
No derivative goes through an iteration: each is that of an optimum, by the implicit function theorem.

Inner functions are jitted although they only run inside others: JAX then keeps what ``vmap`` makes of them, which loops
within loops ask for again and again. For the same reason the starts of a subject come one after the other.
"""

from adapt.differentiable.adapted_subject import AdaptedSubject, adapt_subject, objective
from adapt.differentiable.closest_posture import PostureFit, fit_posture
from adapt.differentiable.errors_of_subject import WEIGHT, OwnPrior

__all__ = ["WEIGHT", "AdaptedSubject", "OwnPrior", "PostureFit", "adapt_subject", "fit_posture", "objective"]
