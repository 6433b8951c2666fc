"""Effects whose size differs between persons: the size of each, fitted beside its adapted parameters.

    min over theta and v of E = D + w (mean(J_p) + |v|^2 / (6 n)),   sizes = mean + SD v

of n postures with six measured angles. A size an SD off counts as much as a degree in one angle of one posture: with
SDs between persons over the SD of the noise that is the posterior mode for white noise, D standing for what is believed
of the parameters.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from adapt.solvers.batched.subject import Fixed
from adapt.solvers.extended.gauss_newton import minimise
from adapt.solvers.extended.joint_parts import Parts, Shared
from adapt.solvers.extended.nearest_posture import strengths_of
from adapt.solvers.extended.problem_rows import parts_of, rows_of
from models.effects import ActiveEffects
from motions.rotations import DEG

_MOST_STEPS = 400
"""Of measured shoulders with three to five causes half take fewer than 140, the hardest 350."""

_SETTLED = 1e-8
"""Decrease of E, mm^2, in a step at which the sizes are found: E is 1 to 1000, its rounding 1e-12 of it."""

_LEAST_WEIGHT = 1e-9
"""Of |v|^2 in E: with w = 0 nothing says anything of the sizes, and they stay at the mean."""


class OwnSizes(NamedTuple):
    """Where the fits ended."""

    sizes: Float[np.ndarray, "sizes problems"]
    """v: in SDs off the mean."""
    theta_mm: Float[np.ndarray, "adapted problems"]
    E: Float[np.ndarray, " problems"]
    """Without the sizes' own term."""
    settled: Bool[np.ndarray, " problems"]


def own_sizes(
    fixed: Fixed,
    active_effects: ActiveEffects,
    theta: Float[np.ndarray, "adapted problems"],
    angles: Float[np.ndarray, "6 postures problems"],
) -> OwnSizes:
    """Find the sizes of each problem's person from here (mm, rad)."""
    problem, posture = rows_of(fixed)
    parts = parts_of(fixed, active_effects)
    columns = [np.asarray(one)[:, :, posture, problem] for one in active_effects.own]
    weight = weight_of_sizes(parts)
    shape = len(parts.group), sum(map(len, columns))
    scale = np.broadcast_to(1.0 / np.sqrt(weight)[:, None], shape)
    shared = Shared(strengths_of(columns), scale, np.zeros(shape))
    start = angles[:, posture, problem] * float(DEG)
    end = minimise(parts, shared, theta.T, np.zeros(shape), lambda gain, _: gain < _SETTLED, _MOST_STEPS, start)
    return OwnSizes(end.amplitude.T, end.theta_mm.T, end.E, end.settled)


def weight_of_sizes(parts: Parts) -> Float[np.ndarray, " parts"]:
    """Give the weight of |v|^2 in E: that of one degree in one angle of a posture."""
    return np.maximum(parts.sums(parts.weights) / parts.sums(np.ones(len(parts.weights))), _LEAST_WEIGHT)
