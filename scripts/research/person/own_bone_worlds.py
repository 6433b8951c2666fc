"""Simulated people with own bones: worlds that define how people differ, and the truth about each person."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from numpy.random import PCG64, Generator

from adapt.solvers import status
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.projection.nearest_posture import nearest_by_numbers
from models.adapted_parameters import ADAPTED
from models.effects import NO_ACTIVE_EFFECTS
from models.girdle import Girdle, bone_rotations
from models.parameter_sets import ParameterSet
from models.person.own_bones import NAMES, SHOWN_BY_LANDMARKS, SIZES, of_chain, spread_about
from motions.rhythm_subjects import add_noise, noise_free_subjects
from motions.rotations import DEG, rotate
from motions.table import Motions

_DRAWN = 4
"""Persons drawn for each person wanted; a person whose chain does not close in every posture is left out."""

OTHER_SDS = {
    **dict(zip(ADAPTED, (10.0, 5.0, 4.0, 12.0, 4.0, 1.5), strict=True)),
    **dict.fromkeys(("TS_x", "AI_x", "AI_y"), 6.0),
    **{name: 4.0 for name in NAMES if "_conoid_" in name},
}
"""SDs between people from an earlier study, mm: not the SDs of the prior, and 0 for all other sizes."""

Sds = Float[np.ndarray, " sizes"]


def _as_prior(adapted: float, others: float) -> Callable[[ParameterSet], Sds]:
    return lambda model: spread_about(model).sd * np.where(np.arange(len(SIZES)) < len(ADAPTED), adapted, others)


def _as_given(sds: Mapping[str, float]) -> Callable[[ParameterSet], Sds]:
    return lambda _: np.array([sds.get(name, 0.0) for name in NAMES])


WORLDS: dict[str, Callable[[ParameterSet], Sds]] = {
    "as the prior": _as_prior(1.0, 1.0),
    "all half as much": _as_prior(0.5, 0.5),
    "all twice as much": _as_prior(2.0, 2.0),
    "bones, frames half": _as_prior(1.0, 0.5),
    "bones, frames twice": _as_prior(1.0, 2.0),
    "other SDs": _as_given(OTHER_SDS),
    "only the six": _as_given({name: OTHER_SDS[name] for name in ADAPTED}),
    "nobody": _as_given({}),
}
"""SD of each of ``SIZES`` between the people of a world about a set, in the units of the size."""


@dataclass(frozen=True)
class People:
    """P simulated persons and the truth about them."""

    model: ParameterSet
    sds: Sds
    noise_deg: float
    motions: Motions
    """Motions with noise."""
    true_deg: Float[np.ndarray, "postures 6"]
    sizes: Float[np.ndarray, "sizes P"]
    closing: float
    """Share of the persons drawn whose chain closes in every posture."""

    @property
    def numbers_mm(self) -> Float[np.ndarray, "numbers P"]:
        """Numbers of the true girdles."""
        return np.asarray(self.model.girdle.numbers_mm)[:, None] + _per_unit(self.model) @ self.sizes

    @property
    def adapted_mm(self) -> Float[np.ndarray, "adapted P"]:
        """Six adapted parameters of the true girdles."""
        return np.asarray(Girdle.of_numbers(self.numbers_mm).adapted_mm)


def _per_unit(model: ParameterSet) -> Float[np.ndarray, "numbers sizes"]:
    return np.stack([size.per_unit(model.girdle) for size in SIZES], axis=-1)


def simulate_people(model: ParameterSet, sds: Sds, count: int, noise_deg: float, seed: int) -> People:
    """Simulate persons that follow the rhythm as closely as their own girdles allow, fourteen postures each."""
    generator = Generator(PCG64(seed))
    wanted = noise_free_subjects(_DRAWN * count, generator)
    sizes = sds[:, None] * generator.standard_normal((len(SIZES), _DRAWN * count))
    numbers = np.asarray(model.girdle.numbers_mm)[:, None] + _per_unit(model) @ sizes
    person = wanted.subject_number
    fitted = fit_batch(
        Girdle.of_numbers(numbers[:, person]), wanted.angles_deg.T / DEG, np.ones((6, len(person)), bool)
    )
    closes = np.bincount(person, fitted.status != status.OK) == 0
    chosen = np.flatnonzero(closes)[:count]
    rows = np.isin(person, chosen)
    closed = replace(wanted, angles_deg=fitted.angles.T * DEG).select(rows)
    noisy = add_noise(closed, noise_deg, generator)
    return People(model, sds, noise_deg, noisy, closed.angles_deg, sizes[:, chosen], float(closes.mean()))


def with_landmarks(people: People, noise_mm: float) -> Motions:
    """Add positions of SC, AC, TS and AI on the true bones; sizes of joints and measured frames do not move them."""
    shown = (
        np.asarray(people.model.girdle.numbers_mm)[:, None]
        + _per_unit(people.model)[:, SHOWN_BY_LANDMARKS] @ (people.sizes[SHOWN_BY_LANDMARKS])
    )
    girdle = Girdle.of_numbers(shown[:, people.motions.subject_number])
    clavicle, scapula = bone_rotations(people.true_deg.T / DEG)
    AC = girdle.sc_mm + rotate(clavicle, girdle.ac_mm)
    TS, AI = (AC + rotate(scapula, point) for point in (girdle.ts_mm, girdle.ai_mm))
    generator = Generator(PCG64(people.motions.subject_number.size))
    places = {"SC": girdle.sc_mm, "AC": AC, "TS": TS, "AI": AI}
    noisy = {name: np.asarray(x) + noise_mm * generator.standard_normal(x.shape) for name, x in places.items()}
    return replace(people.motions, landmarks_mm={name: x.T for name, x in noisy.items()})


def limit(people: People, noise_deg: float) -> Float[np.ndarray, " adapted"]:
    """Compute the smallest possible SD of each of the six parameters, relative to the people's, with the prior known.

    The root mean square over persons of the posterior SD, from the derivatives at the truth: no estimate has a smaller
    mean error, as far as the chain is linear over the SDs. NaN where people do not differ.
    """
    rows = people.motions.subject_number
    angles = people.true_deg.T / DEG
    numbers = of_chain(people.numbers_mm)[:, rows]
    near = nearest_by_numbers(numbers, NO_ACTIVE_EFFECTS, angles, np.ones(angles.shape, bool), angles)
    columns = of_chain(_per_unit(people.model) * people.sds)
    slopes = np.einsum("ikr,ks->rsi", near.by_theta, columns) / noise_deg
    each = np.add.reduceat(slopes @ np.swapaxes(slopes, 1, 2), np.searchsorted(rows, np.arange(rows[-1] + 1)))
    variance = np.einsum("pss->ps", np.linalg.inv(each + np.eye(len(SIZES))))
    left = np.sqrt(variance.mean(axis=0))[: len(ADAPTED)]
    return np.where(people.sds[: len(ADAPTED)] > 0.0, left, np.nan)
