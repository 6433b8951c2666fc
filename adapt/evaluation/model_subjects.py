"""Subjects simulated by the model itself, with one unmodelled effect active: ground truth for fits and diagnosis.

Every result of this module is simulated, and is labelled so.
"""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy.random import PCG64, Generator

from adapt.solvers import status
from adapt.solvers.posture_fits import fit_batch
from models.adapted_parameters import ADAPTED, PERSON_SD_MM
from models.effects import ActiveEffects, Effect, ExtendedGirdle
from models.effects.own_effects import check_own_effects
from models.girdle import Girdle
from models.parameter_sets import ParameterSet
from motions.rhythm_subjects import add_noise, noise_free_subjects
from motions.rotations import DEG
from motions.table import Motions

AMPLITUDE_SPREAD = 0.25
"""SD of an amplitude between subjects, as a share of the population amplitude."""


@dataclass(frozen=True)
class Simulated:
    """Motions with noise, and the true parameters and amplitudes behind them, one row per subject."""

    motions: Motions
    truth: pd.DataFrame


def simulate_model_subjects(
    model: ParameterSet,
    effect: Effect | None,
    subjects: int,
    noise_deg: float,
    seed: int,
    size: float = 1.0,
    spread: float = 1.0,
) -> Simulated:
    """Simulate subjects whose girdle is the model with parameters of their own and, if given, an active effect.

    Each subject moves as close to the published rhythm as its chain allows (posture fit); noise is added. The amplitude
    of the effect is ``size`` times its prior's SD (or its mean, where the mean is not 0) in each of its directions,
    without bending terms of the basis. Its signs are the same for all subjects (those of the prior, else drawn), and
    amplitudes differ by ``AMPLITUDE_SPREAD`` between subjects. Parameters differ by ``spread`` times PERSON_SD_MM.
    Postures that the chain cannot take are left out. Raises ValueError for a user's own effect that does nothing, or
    something at amplitude 0.
    """
    check_own_effects(() if effect is None else (effect,), model.girdle)
    generator = Generator(PCG64(seed))
    wanted = noise_free_subjects(subjects, generator)
    apart = spread * PERSON_SD_MM[:, None] * generator.standard_normal((len(ADAPTED), subjects))
    theta = np.asarray(model.girdle.adapted_mm)[:, None] + apart
    theta = np.clip(theta, *(bound[:, None] for bound in model.bounds_mm))
    amplitude = _amplitudes(effect, subjects, size, wanted, generator)
    row = np.repeat(np.arange(subjects), len(wanted.posture) // subjects)
    chain = _chain(model.girdle, theta[:, row], effect, amplitude[:, row], wanted)
    fitted = fit_batch(chain, wanted.angles_deg.T / DEG, np.ones((6, len(row)), bool))
    closed = replace(wanted, angles_deg=fitted.angles.T * DEG).select(fitted.status == status.OK)
    truth = pd.DataFrame({"subject": wanted.subjects, "effect": effect.name if effect else "none"})
    for k, name in enumerate(ADAPTED):
        truth[f"{name}_mm"] = theta[k]
    for k in range(len(amplitude)):
        truth[f"amplitude_{k + 1}"] = amplitude[k]
    return Simulated(add_noise(closed, noise_deg, generator), truth)


def _amplitudes(
    effect: Effect | None, subjects: int, size: float, wanted: Motions, generator
) -> Float[np.ndarray, "n subjects"]:
    if effect is None:
        return np.zeros((0, subjects))
    signs = np.repeat(effect.prior.sign or (0,) * len(effect.directions), len(effect.basis.sd))
    signs = np.where(signs, signs, generator.choice([-1.0, 1.0], effect.amplitudes))
    mean, sd = effect.amplitude_prior(wanted)
    common = size * np.where(mean > 0, mean, sd * signs)
    common[np.arange(effect.amplitudes) % len(effect.basis.sd) > 0] = 0.0
    return common[:, None] * (1.0 + AMPLITUDE_SPREAD * generator.standard_normal((1, subjects)))


def _chain(girdle: Girdle, theta, effect: Effect | None, amplitude, wanted: Motions) -> Girdle | ExtendedGirdle:
    count = len(wanted.posture)
    repeated = girdle.repeated(count).with_adapted(theta)
    if effect is None:
        return repeated
    strengths = np.einsum("ap,acp->cp", amplitude, effect.columns(wanted))
    return ActiveEffects((strengths,), (effect,)).on(repeated)
