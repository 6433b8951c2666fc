"""A hypothesis fitted to all subjects as a linear model, and what its amplitudes may be beforehand.

A hypothesis is a set of effects at work. In subject s, linear around the most probable parameters,

    y_s = X_s u_s + A_s a_s + noise

with u the adapted parameters in prior standard deviations about the model's own, and a the amplitudes.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from models.adapted_parameters import PRIOR_SD_MM

Hypothesis = tuple[str, ...]
"""Names of the effects at work; empty for none."""


def single_hypotheses(names: Iterable[str]) -> list[Hypothesis]:
    """List the hypotheses that nothing is at work, and each effect alone."""
    return [(), *((name,) for name in names)]


_ADAPTED = len(PRIOR_SD_MM)

BETWEEN_SUBJECTS = 0.3
"""Prior SD of a subject's amplitude about the common one, as a share of the effect's scale."""


@dataclass(frozen=True)
class AmplitudePrior:
    """Prior of some amplitudes: mean and SD of the common part, SD of each subject's deviation from it."""

    mean: Float[np.ndarray, " amplitudes"]
    common: Float[np.ndarray, " amplitudes"]
    between: Float[np.ndarray, " amplitudes"]

    def __add__(self, other: "AmplitudePrior") -> "AmplitudePrior":
        return AmplitudePrior(
            *(np.concatenate(both) for both in zip(vars(self).values(), vars(other).values(), strict=True))
        )

    def __mul__(self, factor: float) -> "AmplitudePrior":
        return AmplitudePrior(*(factor * value for value in vars(self).values()))


def shared_prior(scale: Float[np.ndarray, " amplitudes"]) -> AmplitudePrior:
    """Build the prior of amplitudes that vary little between subjects."""
    return AmplitudePrior(0.0 * scale, scale, BETWEEN_SUBJECTS * scale)


def independent_prior(scale: Float[np.ndarray, " amplitudes"]) -> AmplitudePrior:
    """Build the prior of amplitudes that every subject has for itself, of either sign."""
    return AmplitudePrior(0.0 * scale, 0.0 * scale, np.sqrt(1.0 + BETWEEN_SUBJECTS**2) * scale)


def common_shift(fraction: float) -> AmplitudePrior:
    """Build the prior of adapted parameters that are off by the same in all subjects (see
    ``InnerProducts.with_shift``): the people measured are not on average the person whose girdle the parameter set is.
    ``fraction`` is that of their SD between people."""
    nothing = np.zeros(_ADAPTED)
    return AmplitudePrior(nothing, nothing + fraction, nothing)


Spread = Callable[[Float[np.ndarray, " amplitudes"]], AmplitudePrior]
"""``shared_prior`` or ``independent_prior``."""


@dataclass(frozen=True)
class LinearisedFit:
    """A hypothesis fitted to all subjects, linear around its most probable parameters (see ``map_fit``)."""

    hypothesis: Hypothesis
    z: Float[np.ndarray, "parameters subjects"]
    nearest: Float[np.ndarray, "quantities postures subjects"]
    y: Float[np.ndarray, "subjects residuals"]
    """Whitened residuals at z."""
    X: Float[np.ndarray, "subjects residuals 6"]
    """Their derivatives by the adapted parameters, in their prior standard deviations."""
    A: Float[np.ndarray, "subjects residuals amplitudes"]
    """Their derivatives by the amplitudes, in units of the effect."""
    scale: Float[np.ndarray, " amplitudes"]
    u: Float[np.ndarray, "subjects 6"]
    a: Float[np.ndarray, "subjects amplitudes"]
    """The adapted parameters at z in prior standard deviations, and the amplitudes."""
    linear: Float[np.ndarray, "subjects residuals"]
    """X u + A a - y at z: y of other u and a is X u + A a - linear."""
    root: Float[np.ndarray, "subjects postures m m"]
    by_angle: Float[np.ndarray, "subjects postures m 6"]
    """What a unit of each equation, and a rad of each measured angle, adds to y (see ``misfit.Misfit``)."""
    spread: Float[np.ndarray, " 6"] = field(default_factory=lambda: np.ones(_ADAPTED))
    """By which share of its ``PRIOR_SD_MM`` each adapted parameter varies between subjects: that is the unit of u and
    X."""

    def with_noise(self, factor: float) -> "LinearisedFit":
        """Scale to noise that is ``factor`` times what it was taken for."""
        changed = {name: getattr(self, name) / factor for name in ("y", "X", "A", "linear", "root", "by_angle")}
        return replace(self, **changed)

    def with_spread(self, spread: Float[np.ndarray, " 6"]) -> "LinearisedFit":
        """Rescale u and X to other spreads of the adapted parameters, as shares of ``PRIOR_SD_MM``."""
        ratio = spread / self.spread
        return replace(self, X=ratio * self.X, u=self.u / ratio, spread=spread)
