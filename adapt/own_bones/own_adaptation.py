"""Adaptation with bones and frames of each person's own, in place of min E = D + w mean(J) within bounds.

    E_own = w / m (S + sigma^2 |z|^2)

with S the sum of the squared differences of the m measured angles, deg^2: -2 log of the posterior
(``own_bones.most_probable``) times w sigma^2 / m. With six angles in each posture S / m is mean(J), and the other term
takes the place of D. D has no part in it: the thorax points of a set are another person's, and move and grow with the
thorax. What they say of this person is how far people differ, the prior of the six adapted parameters; a set with
points of the person has the SDs of their fit there. w changes no optimum.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from adapt.engine.batching import take_problems
from adapt.own_bones.curved_posterior import covariance_of_u, overstated
from adapt.own_bones.lowest_minimum import with_lowest_postures
from adapt.own_bones.most_probable import (
    STARTS_MM,
    Posterior,
    Prior,
    Rows,
    most_probable,
    staged,
)
from adapt.own_bones.posture_steps import persons_first
from adapt.own_bones.scales import (
    IN_GROUP,
    PRIOR,
    Moments,
    Scales,
    are_known,
    learnt,
    moments,
    relative_variances,
)
from adapt.own_bones.unsure import Unsure, told_and_covariance
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted
from adapt.solvers.posture_fits import fit_batch
from adapt.solvers.problems import Problems, problems_of, select_problems
from adapt.solvers.rows import PostureRows, one_in_so_many
from adapt.solvers.solution import PostureSolution
from models.girdle import Girdle
from models.person.family import AnyModel, unique_sets
from models.person.own_bones import GROUPS, NO_SDS, SHOWN_BY_LANDMARKS, OwnSDs, Spread, of_chain, spread_about
from models.person.positions.landmark_numbers import IN_GIRDLE, KEYS, LandmarkNumbers, numbers_of
from models.person.thorax_ellipsoid import thorax_distance_mm2
from motions.table import FEWEST_ANGLES, person_of

_DIMENSIONS = 24
"""What the chain can tell apart: the 27 numbers of a girdle less the three of SC, which stands at 0."""

_FEWEST_PERSONS, _FEWEST = 10, 5
"""Of a run whose scales are learnt, and of those whose fit has settled, another group left out. Six bone-pin shoulders
of three cadavers would make bones twice as different as people's are."""

_LEARNING_ROUNDS = 2
"""Fits whose linearisation the scales are learnt from: of the bone-pin shoulders a third changes none by 5 %."""

_GROUPS = 6
"""Of persons that scales are learnt without: more take longer and tell little more."""

_MOST_PERSONS = 100
"""Of more a sample is learnt from: a hundred tell a scale to some 3 %."""

_LEARNING_STEPS, _NOISE_ROUNDS = 30, 5
"""Scales are learnt from closed chains, where so many steps lead, at an optimum or not: y has what is open, and its
slopes. Most rounds of a noise."""

_RANK = 1e-12
"""Variance, relative to the largest, below which the prior holds a direction at the set's."""


WORDS = np.array(["adapted", "do_not_predict", "not_converged"])
"""What became of the bones of a person's own: where they do not predict the person's motions, or were not found, the
plain adaptation is kept."""

HERE, DO_NOT_PREDICT, NOT_CONVERGED = range(len(WORDS))


class OwnBones(NamedTuple):
    """What was found of each problem's sizes (``models.person.own_bones.SIZES``, in their units)."""

    sizes: Float[np.ndarray, "sizes problems"]
    covariance: Float[np.ndarray, "sizes sizes problems"]
    """By the curvature of the posterior (Gauss-Newton), and what that is too sure of (``unsure``)."""
    prior_sd: Float[np.ndarray, "sizes problems"]
    """With the scale of its group."""
    scales: Float[np.ndarray, "scales problems"]
    """In the order of ``Scales``: of each group, and the noise in degrees."""
    code: Int[np.ndarray, " problems"]
    """Of ``WORDS``."""
    told: Float[np.ndarray, "sizes problems"]
    """The share of the prior variance that was taken away, were the scales known."""

    @property
    def word(self) -> Shaped[np.ndarray, " problems"]:
        """Whether they were adapted, and why not."""
        return WORDS[self.code]

    @property
    def distance(self) -> Float[np.ndarray, " problems"]:
        """How far a person is from the set, in SDs of people, in the directions that the motions tell (one at least).

        Root of |u|^2 / (n - tr of the posterior covariance of u), 1 in the mean where people are as the prior says.
        """
        sd = np.where(self.prior_sd > 0.0, self.prior_sd, 1.0)
        return np.sqrt(((self.sizes / sd) ** 2).sum(axis=0) / np.maximum(self.told.sum(axis=0), 1.0))

    @property
    def sd(self) -> Float[np.ndarray, "sizes problems"]:
        """The posterior SDs."""
        return np.sqrt(np.einsum("kkp->kp", self.covariance))


def spread_of(models: Sequence[AnyModel], subjects: Sequence[str], sds: OwnSDs = NO_SDS) -> Spread:
    """Lay out how persons differ about the set of every subject with every model."""
    sets, place = unique_sets(models, subjects)
    each = [spread_about(one, sds) for one in sets]
    return Spread(*(np.stack(parts, axis=-1)[..., place] for parts in zip(*each, strict=True)))


def with_landmarks(
    spread: Spread, data: Problems, rows: PostureRows, models: Sequence[AnyModel], problem: Int[np.ndarray, " parts"]
) -> Spread:
    """Add what positions of landmarks in the postures of each part of a problem say; of what the person's set has
    measured, nothing: it may come from the same landmarks."""
    if not {"SC", "AC", "TS", "AI"} & rows.landmarks_mm.keys():
        return spread
    packed = {name: rows.packed(place) for name, place in rows.landmarks_mm.items()}
    subject = problem % len(rows.subjects)
    found = [
        numbers_of({name: place[..., s] for name, place in packed.items()}, counted)
        for s, counted in zip(subject.tolist(), np.asarray(data.counted).T, strict=True)
    ]
    sets, place = unique_sets(models, rows.subjects)
    measured = np.array([[one.is_measured(key) for key in KEYS] for one in sets])[place[problem]].T
    numbers = LandmarkNumbers(*(np.stack(one, axis=-1) for one in zip(*found, strict=True)))
    return spread.from_landmarks(numbers, np.asarray(data.girdle.numbers_mm)[list(IN_GIRDLE)], ~measured)


@dataclass(frozen=True)
class People:
    """How the persons of a run differ, by the name of a model: what each of them is adapted with."""

    sds: OwnSDs
    """SDs in place of those of ``SIZES``, by name. A dict, which can be sent to a worker."""
    everybody: Mapping[str, Scales]
    without: Mapping[str, Mapping[str, Scales]]
    """By person: learnt without this person, for what is held out. Nobody else's scales know anything of a person."""
    are_few: bool = False
    """Nothing was learnt of them: the noise of each is, alone."""
    unsure: Mapping[str, Unsure] = field(default_factory=dict)
    """What the covariance of sizes is too sure of, without ``problems``."""

    def of(self, models: Sequence[AnyModel], subjects: Sequence[str], held_out: bool = False) -> list[Scales]:
        """Give the scales of every subject with every model."""
        found = []
        for model in models:
            everybody, without = self.everybody[model.name], self.without[model.name] if held_out else {}
            found += [without.get(person_of(subject), everybody) for subject in subjects]
        return found

    def unsure_of(self, models: Sequence[AnyModel], subjects: Sequence[str]) -> Unsure:
        """Lay out what is unsure of every subject with every model; nothing of few persons."""
        each = [self.unsure.get(model.name, Unsure(*np.zeros((2, len(GROUPS))))) for model in models]
        return Unsure(*(np.repeat(np.array(one).T, len(subjects), axis=1) for one in zip(*each, strict=True)))


class _Optimum(NamedTuple):
    """The most probable girdles of some problems, as far as thirty steps lead."""

    rows: Rows
    part: Int[np.ndarray, " rows"]
    prior: Prior
    shares: Float[np.ndarray, "sizes n problems"]
    found: Posterior


def learn_people(rows: PostureRows, models: Sequence[AnyModel], sds: OwnSDs = NO_SDS, held_out: bool = True) -> People:
    """Learn the scales of each model from these subjects, of many from a sample; where parts are ``held_out`` without
    each person of whom it was learnt, of many without each sixth of them."""
    chosen, sds = np.flatnonzero(np.isin(rows.subjects, sample(rows.subjects))), dict(sds)
    subjects = tuple(rows.subjects[k] for k in chosen.tolist())
    persons = [person_of(subject) for subject in subjects]
    different = list(dict.fromkeys(persons))
    everybody = dict.fromkeys((model.name for model in models), PRIOR)
    if len(different) < _FEWEST_PERSONS:
        return People(sds, everybody, {name: {} for name in everybody}, are_few=True)
    parts = np.array_split(np.arange(len(different)), _GROUPS)
    number = {different[k]: g for g, part in enumerate(parts) for k in part.tolist()}
    group = np.array([number[one] for one in persons])
    every, width = np.arange(len(models)), len(chosen)
    data = select_problems(problems_of(rows, models), (len(rows.subjects) * every[:, None] + chosen).ravel())
    spread, of_model = spread_of(models, subjects, sds), np.repeat(every, width)

    def learn(scales: list[Scales]) -> tuple[_Optimum, Moments, Bool[np.ndarray, " problems"], list[Scales]]:
        at = _optimum(data, spread, [scales[k] for k in of_model.tolist()])
        of, known = _moments(spread, at)
        return at, of, known, _learnt_by_enough(of, (of_model == every[:, None]) & known, scales)

    at, of, known, scales = learn(list(everybody.values()))
    for _ in range(_LEARNING_ROUNDS - 1):
        at, of, known, scales = learn(scales)
    everybody = dict(zip(everybody, scales, strict=True))
    variances = _variances_by_enough(of, (of_model == every[:, None]) & known, scales)
    unsure = dict(zip(everybody, map(Unsure, _untold(at, known, len(models)), variances), strict=True))
    if not held_out:
        return People(sds, everybody, {name: {} for name in everybody}, unsure=unsure)
    runs = (of_model == every[:, None, None]) & known & (np.tile(group, len(models)) != np.arange(_GROUPS)[:, None])
    each = _learnt_by_enough(of, runs.reshape(-1, len(known)), [one for one in scales for _ in range(_GROUPS)])
    without = {
        name: {person: each[_GROUPS * k + one] for person, one in zip(persons, group.tolist(), strict=True)}
        for k, name in enumerate(everybody)
    }
    return People(sds, everybody, without, unsure=unsure)


def _untold(at: _Optimum, known: Bool[np.ndarray, " problems"], models: int) -> Float[np.ndarray, "models groups"]:
    """beta of each model over the persons that are known."""
    more, told = (
        (IN_GROUP.T @ one).reshape(len(GROUPS), models, -1).sum(axis=2).T for one in overstated(*at, known, models)
    )
    return np.clip(more / np.where(told > 0.0, told, np.inf), 0.0, 1.0)


def _learnt_by_enough(of: Moments, runs: Bool[np.ndarray, "runs problems"], start: Sequence[Scales]) -> list[Scales]:
    """The scales of each run; of few problems, those of the prior."""
    found, enough = [PRIOR] * len(runs), np.flatnonzero(runs.sum(axis=1) >= _FEWEST).tolist()
    for k, one in zip(enough, learnt(of, runs[enough], [start[k] for k in enough]), strict=True):
        found[k] = one
    return found


def _variances_by_enough(of: Moments, runs: Bool[np.ndarray, "runs problems"], scales: Sequence[Scales]):
    """How unsure the scales of each run are; those of the prior are taken as known."""
    found, enough = np.zeros((len(runs), len(GROUPS))), np.flatnonzero(runs.sum(axis=1) >= _FEWEST)
    found[enough] = relative_variances(of, runs[enough], [scales[k] for k in enough.tolist()])
    return found


def with_own_noise(data: Problems, spread: Spread) -> list[Scales]:
    """Learn the noise of each problem alone, and nothing else.

    A person who is farther from the set than most must not count as noise: the noise is the most probable one together
    with scales of this person's own SDs, and these are then left at 1. Where the chain does not close with a noise, it
    is tried with twice as much.
    """
    noise_deg = np.full(data.counted.shape[1], PRIOR.noise_deg)
    rounds = np.zeros(len(noise_deg), int)
    for _ in range(_NOISE_ROUNDS):
        left = np.flatnonzero(rounds < _LEARNING_ROUNDS)
        if not len(left):
            break
        some = take_problems(spread, left)
        of, known = _moments(some, _optimum(select_problems(data, left), some, _with_noise(noise_deg[left])))
        each = learnt(of, np.eye(len(left), dtype=bool)[known], [PRIOR] * int(known.sum()))
        noise_deg[left[known]] = [one.noise_deg for one in each]
        noise_deg[left[~known & (of.informative > 0)]] *= 2.0
        rounds[left[known | (of.informative == 0)]] += 1
    return _with_noise(noise_deg)


def _with_noise(noise_deg: Float[np.ndarray, " problems"]) -> list[Scales]:
    return [PRIOR._replace(noise_deg=one) for one in noise_deg.tolist()]


def sample(subjects: Sequence[str]) -> tuple[str, ...]:
    """Take the subjects that scales are learnt from, of many one in so many in the order of the files."""
    return one_in_so_many(subjects, _MOST_PERSONS)


def _optimum(data: Problems, spread: Spread, scales: Sequence[Scales]) -> _Optimum:
    rows, part, _ = _rows_of(data)
    prior, shares = _prior(data, spread, scales)
    found = most_probable(rows, part, prior, *staged(rows, part, prior, STARTS_MM[0]), _LEARNING_STEPS)
    return _Optimum(rows, part, prior, shares, found)


def _moments(spread: Spread, at: _Optimum) -> tuple[Moments, Bool[np.ndarray, " problems"]]:
    """And of whom there are any."""
    of = moments(of_chain(spread.columns_mm), at.prior, at.found, at.rows, at.part)
    return of, at.found.closed & are_known(of)


def adapt_own_bones(
    data: Problems,
    spread: Spread,
    scales: Sequence[Scales],
    weight: float,
    unsure: Unsure | None = None,
    kin: Int[np.ndarray, " problems"] | None = None,
) -> tuple[Problems, Adapted, OwnBones]:
    """Find the most probable girdle of each problem: the problems with that girdle, the adaptation and the sizes.

    ``unsure``: what the covariance of the sizes is less sure of than the slopes say; without it, nothing. ``kin``: a
    number that problems with other postures of the same person share; without it, each is of another person.
    """
    rows, part, posture = _rows_of(data)
    prior, shares = _prior(data, spread, scales)
    found = with_lowest_postures(rows, part, prior, np.arange(len(scales)) if kin is None else kin)
    own, moved_mm = _own_bones(spread, scales, prior, shares, found, part, unsure or Unsure.nothing(len(scales)))
    girdle = Girdle.of_numbers(np.asarray(data.girdle.numbers_mm) + moved_mm)
    data = replace(data, girdle=girdle)
    fitted = fit_batch(
        data.girdles_at(girdle.adapted_mm, posture, part), rows.angles, rows.measured, found.nearest.angles
    )
    return data, _as_adapted(data, weight, found, fitted, (posture, part)), own


def _rows_of(data: Problems) -> tuple[Rows, Int[np.ndarray, " rows"], Int[np.ndarray, " rows"]]:
    """The postures that count, problem by problem; the problem and the place of each."""
    problem, posture = np.nonzero(data.counted.T)
    angles, measured = (np.asarray(x)[:, posture, problem] for x in (data.angles, data.measured))
    return Rows(angles, measured, data.active_effects.at(posture, problem)), problem, posture


class _Sizes(NamedTuple):
    """What is believed of the sizes of each problem, in SDs, before any angle is looked at: N(m, L L')."""

    mean: Float[np.ndarray, "problems sizes"]
    root: Float[np.ndarray, "problems sizes sizes"]


def _sizes(spread: Spread, scales: Sequence[Scales]) -> _Sizes:
    """With J the slopes of the numbers that landmarks measure and W their precisions: (1 + J'W J)^-1 (1, J'W more)."""
    n, count = len(spread.sd), len(scales)
    mean, root = np.zeros((count, n)), np.tile(np.eye(n), (count, 1, 1))
    some = np.flatnonzero(np.isfinite(spread.more_mm).any(axis=0))
    if len(some):
        J = spread.columns_mm[list(IN_GIRDLE)] * (_of_sizes(scales) * SHOWN_BY_LANDMARKS[:, None])
        more, J = persons_first(spread.more_mm)[some], persons_first(J)[some]
        known = np.isfinite(more)
        W = np.where(known, persons_first(spread.more_sd_mm)[some], 1.0) ** -2.0 * known
        covariance = np.linalg.inv(np.eye(n) + np.swapaxes(J, 1, 2) @ (W[:, :, None] * J))
        mean[some] = np.einsum("pst,pkt,pk->ps", covariance, J, W * np.where(known, more, 0.0))
        root[some] = np.linalg.cholesky(covariance)
    return _Sizes(mean, root)


def _prior(
    data: Problems, spread: Spread, scales: Sequence[Scales]
) -> tuple[Prior, Float[np.ndarray, "sizes n problems"]]:
    """The prior of the chain, and what of the sizes (L^-1 (z - m)) u stands for: B' (R')^+ with B = C L."""
    columns, before = persons_first(of_chain(spread.columns_mm) * _of_sizes(scales)), _sizes(spread, scales)
    B = columns @ before.root
    moved = (columns @ before.mean[..., None])[..., 0].T
    covariance = B @ np.swapaxes(B, 1, 2)
    variance, vectors = (one[..., -_DIMENSIONS:] for one in np.linalg.eigh(covariance))
    held = variance <= _RANK * variance.max(axis=1, keepdims=True)
    sd = np.where(held, 0.0, np.sqrt(np.maximum(variance, 0.0)))
    across = np.where(held, 0.0, 1.0 / np.where(held, 1.0, sd))
    root = np.moveaxis(vectors * sd[:, None], 0, -1)
    shares = np.moveaxis(np.swapaxes(B, 1, 2) @ (vectors * across[:, None]), 0, -1)
    noise = np.array([one.noise_deg for one in scales])
    return Prior(of_chain(np.asarray(data.girdle.numbers_mm)) + moved, root, noise), shares


def _of_sizes(scales: Sequence[Scales]) -> Float[np.ndarray, "sizes problems"]:
    return np.stack([one.of_sizes for one in scales], axis=-1)


def _own_bones(
    spread: Spread, scales: Sequence[Scales], prior: Prior, shares, found: Posterior, part, unsure: Unsure
) -> tuple[OwnBones, Float[np.ndarray, "numbers problems"]]:
    """The posterior of the sizes: their means, and what they add to the girdle."""
    sd, shares, before = persons_first(spread.sd * _of_sizes(scales)), persons_first(shares), _sizes(spread, scales)
    S = before.root @ shares
    mean = before.mean + (S @ persons_first(found.u)[..., None])[..., 0]
    told = (S - S @ covariance_of_u(found, prior, part)) @ np.swapaxes(S, 1, 2)
    told, covariance = told_and_covariance(before.root @ np.swapaxes(before.root, 1, 2), told, unsure)
    own = OwnBones(
        (sd * mean).T,
        np.moveaxis(sd[:, :, None] * sd[:, None] * covariance, 0, -1),
        sd.T,
        np.stack([np.array(one) for one in scales], axis=-1),
        np.full(len(scales), HERE),
        told.T,
    )
    columns = persons_first(spread.columns_mm * _of_sizes(scales))
    return own, (columns @ mean[..., None])[..., 0].T


def _as_adapted(data: Problems, weight: float, found: Posterior, fitted: PostureSolution, place) -> Adapted:
    _, problem = place
    count = data.counted.shape[1]
    angles = np.asarray(data.measured)[:, *place].sum(axis=0)

    def laid_out(values):
        whole = np.full((*values.shape[:-1], *data.counted.shape), np.nan)
        whole[..., *place] = values
        return whole

    theta = np.asarray(data.girdle.adapted_mm)
    several = np.append(np.arange(count), 0)  # of one problem alone numpy adds up in another order
    D = thorax_distance_mm2(*take_problems((data.girdle, data.points_mm, data.point_weights), several))[:count]
    mean_j = np.bincount(problem, fitted.j_deg2, count) / np.maximum(np.bincount(problem, minlength=count), 1)
    closed = np.bincount(problem, ~fitted.converged, count) == 0
    determined = np.bincount(problem, angles < FEWEST_ANGLES, count) == 0
    code = np.where(found.settled & closed & np.isfinite(D), status.CONVERGED, status.UNCONVERGED)
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
        E=weight * found.F / np.maximum(np.bincount(problem, angles, count), 1),
        weight=np.full(count, float(weight)),
        point_weights=np.asarray(data.point_weights),
        landmark_weight=np.zeros(count),
        iterations=found.steps,
        sizes=np.zeros((0, count)),
        code=np.where(determined, code, status.UNUSABLE),
    )
