"""Adaptation with bones and frames of each person's own, in place of min E = D + w mean(J) within bounds.

    E_own = w / m (S + sigma^2 |z|^2)

with S the sum of the squared differences of the m measured angles, deg^2: -2 log of the posterior of
``adapt.own_bones.posterior`` times w sigma^2 / m. With six angles in each posture S / m is mean(J), and the other term
takes the place of D. D has no part in it: the thorax points of a set are another person's, and move and grow with the
thorax. What they say of this person is how far people differ, the prior of the six adapted parameters; a set with
points of the person has the SDs of their fit there (``models.person.thorax_ellipsoid.thorax_sd_mm``). w changes no
optimum.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from adapt.engine.batching import put_problems, take_problems
from adapt.own_bones.posterior import Posterior, Prior, Rows, most_probable
from adapt.own_bones.scales import Moments, Scales, learnt, moments, sampled
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import Problems
from adapt.solvers.solution import PostureSolution
from models.adapted_parameters import ADAPTED
from models.girdle import Girdle
from models.person.family import AnyModel, unique_sets
from models.person.own_bones import OwnSDs, Spread, of_chain, spread_about
from models.person.thorax_ellipsoid import thorax_distance_mm2
from motions.table import FEWEST_ANGLES

_DIMENSIONS = 24
"""What the chain can tell apart: the 27 numbers of a girdle less the three of SC, which stands at 0."""

_LEARNING_ROUNDS = 2
"""Fits whose linearisation the scales are learnt from: of the bone-pin shoulders a third changes none by 5 %."""

_POSTURE_ROUNDS = 4
"""A person with a posture in the higher of two local minima goes on from the lower one."""

_LOWER_DEG2 = 1e-6
"""A fresh posture fit lower by less than this is the same one."""

_RANK = 1e-12
"""Variance, relative to the largest, below which the prior holds a direction at the set's."""


class OwnBones(NamedTuple):
    """What was found of each problem's sizes (``models.person.own_bones.SIZES``, in their units)."""

    sizes: Float[np.ndarray, "sizes problems"]
    covariance: Float[np.ndarray, "sizes sizes problems"]
    """By the curvature of the posterior (Gauss-Newton)."""
    prior_sd: Float[np.ndarray, "sizes problems"]
    """With the scale of its group."""
    scales: Float[np.ndarray, "scales problems"]
    """In the order of ``Scales``: bones, frames, noise in degrees."""

    @property
    def sd(self) -> Float[np.ndarray, "sizes problems"]:
        """The posterior SDs."""
        return np.sqrt(np.einsum("kkp->kp", self.covariance))


def spread_of(models: Sequence[AnyModel], subjects: Sequence[str], sds: OwnSDs | None = None) -> Spread:
    """Lay out how persons differ about the set of every subject with every model."""
    sets, place = unique_sets(models, subjects)
    each = [spread_about(one, sds) for one in sets]
    return Spread(*(np.stack(parts, axis=-1)[..., place] for parts in zip(*each, strict=True)))


def learn_scales(
    data: Problems, spread: Spread, group: Int[np.ndarray, " problems"]
) -> tuple[Scales, dict[int, Scales]]:
    """Learn the scales from these problems, persons of one model; and without each ``group`` of them in turn."""
    some = sampled(np.arange(len(group)))
    part, chosen = take_problems((data, spread), some)
    scales, of, known = Scales(), None, np.zeros(len(some), bool)
    for _ in range(_LEARNING_ROUNDS):
        of, known = _moments(part, chosen, scales)
        scales = learnt(of, known)
    return scales, {one: learnt(of, known & (group[some] != one)) for one in np.unique(group).tolist()}


def _moments(data: Problems, spread: Spread, scales: Scales) -> tuple[Moments, Bool[np.ndarray, " problems"]]:
    """And whose fit has settled."""
    count = data.counted.shape[1]
    rows, part, _ = _rows_of(data)
    prior, _ = _prior(data, spread, [scales] * count)
    found = most_probable(rows, part, prior)
    return moments(of_chain(spread.columns_mm), prior, found, part), found.settled


def adapt_own_bones(
    data: Problems,
    spread: Spread,
    scales: Sequence[Scales],
    weight: float,
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[Problems, Adapted, OwnBones]:
    """Find the most probable girdle of each problem: the problems with that girdle, the adaptation and the sizes."""
    progress("bones of each person's own")
    rows, part, posture = _rows_of(data)
    prior, shares = _prior(data, spread, scales)
    found = _with_lowest_postures(rows, part, prior)
    own, moved_mm = _own_bones(spread, scales, prior, shares, found, part)
    girdle = Girdle.of_numbers(np.asarray(data.girdle.numbers_mm) + moved_mm)
    data = replace(data, girdle=girdle)
    fitted = fit_batch(
        data.girdles_at(girdle.adapted_mm, posture, part), rows.angles, rows.measured, found.nearest.angles
    )
    return data, _as_adapted(data, weight, own, prior, found, fitted, (posture, part)), own


def _rows_of(data: Problems) -> tuple[Rows, Int[np.ndarray, " rows"], Int[np.ndarray, " rows"]]:
    """The postures that count, problem by problem; the problem and the place of each."""
    problem, posture = np.nonzero(data.counted.T)
    angles, measured = (np.asarray(x)[:, posture, problem] for x in (data.angles, data.measured))
    return Rows(angles, measured, data.active_effects.at(posture, problem)), problem, posture


def _prior(data: Problems, spread: Spread, scales: Sequence[Scales]) -> tuple[Prior, Float[np.ndarray, "sizes n problems"]]:
    """The prior of the chain, and the sizes (in SDs) that u stands for: B' (R')^+."""
    B = of_chain(spread.columns_mm) * _of_sizes(scales)
    covariance = np.einsum("ksp,lsp->pkl", B, B)
    variance, vectors = (one[..., -_DIMENSIONS:] for one in np.linalg.eigh(covariance))
    held = variance <= _RANK * variance.max(axis=1, keepdims=True)
    sd = np.where(held, 0.0, np.sqrt(np.maximum(variance, 0.0)))
    across = np.where(held, 0.0, 1.0 / np.where(held, 1.0, sd))
    root = np.moveaxis(vectors * sd[:, None], 0, -1)
    shares = np.einsum("ksp,pkn->snp", B, vectors * across[:, None])
    noise = np.array([one.noise_deg for one in scales])
    return Prior(of_chain(np.asarray(data.girdle.numbers_mm)), root, noise), shares


def _of_sizes(scales: Sequence[Scales]) -> Float[np.ndarray, "sizes problems"]:
    return np.stack([one.of_sizes for one in scales], axis=-1)


def _with_lowest_postures(rows: Rows, part: Int[np.ndarray, " rows"], prior: Prior) -> Posterior:
    """The most probable girdles, and again from where a posture fits better elsewhere."""
    found = most_probable(rows, part, prior)
    left = np.arange(len(prior.noise_deg))
    for _ in range(_POSTURE_ROUNDS):
        mine = np.isin(part, left)
        some, number = Rows(rows.angles[:, mine], rows.measured[:, mine], rows.active_effects.at(mine)), part[mine]
        girdle = Girdle.of_numbers(prior.numbers_at(found.u)[:, number])
        fresh = fit_batch(some.active_effects.on(girdle), some.angles, some.measured)
        near = take_problems(found.nearest, mine)
        lower = fresh.converged & (fresh.j_deg2 * some.measured.sum(axis=0) < (near.y**2).sum(axis=0) - _LOWER_DEG2)
        left = np.unique(number[lower])
        if not len(left):
            break
        again = np.isin(number, left)
        mine = np.isin(part, left)
        start = np.where(lower, fresh.angles, near.angles)[:, again]
        some = Rows(rows.angles[:, mine], rows.measured[:, mine], rows.active_effects.at(mine))
        further = most_probable(
            some, np.searchsorted(left, part[mine]), take_problems(prior, left), found.u[:, left], start
        )
        put_problems(found.nearest, np.flatnonzero(mine), further.nearest)
        for whole, one in zip(found, further, strict=True):
            if isinstance(one, np.ndarray):
                whole[..., left] = one
    return found


def _own_bones(
    spread: Spread, scales: Sequence[Scales], prior: Prior, shares, found: Posterior, part: Int[np.ndarray, " rows"]
) -> tuple[OwnBones, Float[np.ndarray, "numbers problems"]]:
    """The posterior of the sizes: their means, and what they add to the girdle."""
    sd = spread.sd * _of_sizes(scales)
    mean = np.einsum("snp,np->sp", shares, found.u)
    slopes = np.einsum("ikr,knr->inr", found.nearest.by_theta, prior.root_mm[..., part])
    each_row = np.einsum("inr,imr->nmr", slopes, slopes)
    matrix = np.add.reduceat(each_row, np.searchsorted(part, np.arange(found.u.shape[1])), axis=-1)
    of_u = np.linalg.inv(np.moveaxis(matrix / prior.noise_deg**2, -1, 0) + np.eye(len(found.u)))  # prior variance 1
    unseen = np.eye(len(sd))[..., None] - np.einsum("snp,tnp->stp", shares, shares)
    covariance = unseen + np.einsum("snp,pnm,tmp->stp", shares, of_u, shares, optimize=True)
    each = np.stack([np.array(one) for one in scales], axis=-1)
    own = OwnBones(sd * mean, sd[:, None] * sd[None] * covariance, sd, each)
    return own, np.einsum("ksp,sp->kp", spread.columns_mm * _of_sizes(scales), mean)


def _as_adapted(
    data: Problems, weight: float, own: OwnBones, prior: Prior, found: Posterior, fitted: PostureSolution, place
) -> Adapted:
    _, problem = place
    count = data.counted.shape[1]
    measured = np.bincount(problem, np.asarray(data.measured)[:, *place].sum(axis=0), count)

    def laid_out(values, otherwise=np.nan):
        whole = np.full((*values.shape[:-1], *data.counted.shape), otherwise)
        whole[..., *place] = values
        return whole

    theta = np.asarray(data.girdle.adapted_mm)
    D = np.asarray(thorax_distance_mm2(data.girdle, data.points_mm, data.point_weights))
    mean_j = np.bincount(problem, fitted.j_deg2, count) / np.maximum(np.bincount(problem, minlength=count), 1)
    closed = np.bincount(problem, ~fitted.converged, count) == 0
    determined = np.bincount(problem, np.asarray(data.measured)[:, *place].sum(axis=0) < FEWEST_ANGLES, count) == 0
    words = np.where(found.settled & closed & np.isfinite(D), status.OK, status.NOT_CONVERGED)
    return Adapted(
        theta_mm=theta,
        at_bound=np.zeros(theta.shape, bool),
        angles=np.where(data.counted, laid_out(fitted.angles), np.asarray(data.angles)),
        multipliers=laid_out(fitted.multipliers),
        residual_mm=laid_out(fitted.residual_mm),
        stationarity=laid_out(fitted.stationarity),
        D_mm2=D,
        L_mm2=np.full(count, np.nan),
        mean_j_deg2=mean_j,
        E=weight * found.F / np.maximum(measured, 1),
        weight=np.full(count, float(weight)),
        point_weights=np.asarray(data.point_weights),
        landmark_weight=np.zeros(count),
        iterations=found.steps,
        sizes=np.zeros((0, count)),
        status=np.where(determined, words, status.INVALID).astype("U16"),
    )
