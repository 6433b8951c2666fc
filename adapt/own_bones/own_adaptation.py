"""Adaptation with own bones: bones and measured frames of each person.

In place of E = D + w mean(J) within bounds, the objective is

    E_own = w / m (S + sigma^2 |z|^2)

with S the sum of the squared differences of the m measured angles, deg^2: -2 log of the posterior
(``own_bones.most_probable``) times w sigma^2 / m. With six angles in each posture S / m is mean(J), and the second term
takes the place of D. D is left out because the thorax points of a set are another person's, and move and grow with the
thorax. The points inform about this person only by how far people differ, the prior of the six adapted parameters; in a
set with points of the person, this prior has the SDs of the fit to these points. w does not change the optimum.
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
    log_likelihoods,
    misfits,
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
"""Number of directions that the chain can distinguish: the 27 numbers of a girdle less the three of SC, which is 0."""

_FEWEST_PERSONS, _FEWEST = 10, 5
"""Fewest persons of a run whose scales are learnt, and fewest problems with a usable fit, also with a group left out.
From six bone-pin shoulders of three cadavers, bones would seem to differ twice as much as between people."""

_LEARNING_ROUNDS = 2
"""Number of rounds: a fit, and scales learnt from its linearisation. A third round changes no scale of the bone-pin
shoulders by 5 %."""

_GROUPS = 6
"""Number of groups of persons left out in turn when scales are learnt. More groups take longer and change little."""

_MOST_PERSONS = 100
"""Largest number of subjects that scales are learnt from; of more, a sample is taken. A hundred determine
a scale to some 3 %."""

_LEARNING_STEPS, _NOISE_ROUNDS = 30, 5
"""Largest numbers of steps before scales are learnt, and of rounds for a noise. Chains have to be closed but need not
be at the optimum: y and its Jacobian at the last point contain what remains."""

_RANK = 1e-12
"""Prior variance, relative to the largest, up to which a direction keeps the set's value."""


WORDS = np.array(["adapted", "do_not_predict", "not_converged"])
"""Outcomes of own bones. Where own bones do not predict the person's motions or the search has not converged, the plain
adaptation is kept."""

HERE, DO_NOT_PREDICT, NOT_CONVERGED = range(len(WORDS))


class OwnBones(NamedTuple):
    """Posterior of each problem's sizes (``models.person.own_bones.SIZES``, in their units)."""

    sizes: Float[np.ndarray, "sizes problems"]
    covariance: Float[np.ndarray, "sizes sizes problems"]
    """Posterior covariance by the curvature (Gauss-Newton), widened as in ``unsure``."""
    prior_sd: Float[np.ndarray, "sizes problems"]
    """Prior SD, including the scale of the size's group."""
    scales: Float[np.ndarray, "scales problems"]
    """Scale of each group, then the noise in degrees: the order of ``Scales``."""
    code: Int[np.ndarray, " problems"]
    """Index in ``WORDS``."""
    told: Float[np.ndarray, "sizes problems"]
    """Fraction of the prior variance that the data remove if the scales are known."""

    @property
    def word(self) -> Shaped[np.ndarray, " problems"]:
        """Outcome of each problem, from ``WORDS``."""
        return WORDS[self.code]

    @property
    def distance(self) -> Float[np.ndarray, " problems"]:
        """Distance of a person from the set, in SDs of people, in the directions (at least one) that motions determine.

        Root of |u|^2 / (n - tr of the posterior covariance of u), with mean 1 where people differ as the prior says.
        """
        sd = np.where(self.prior_sd > 0.0, self.prior_sd, 1.0)
        return np.sqrt(((self.sizes / sd) ** 2).sum(axis=0) / np.maximum(self.told.sum(axis=0), 1.0))

    @property
    def sd(self) -> Float[np.ndarray, "sizes problems"]:
        """Posterior SDs of the sizes."""
        return np.sqrt(np.einsum("kkp->kp", self.covariance))


def spread_of(models: Sequence[AnyModel], subjects: Sequence[str], sds: OwnSDs = NO_SDS) -> Spread:
    """Compute the spread of persons about the set of every subject with every model."""
    sets, place = unique_sets(models, subjects)
    each = [spread_about(one, sds) for one in sets]
    return Spread(*(np.stack(one, axis=-1)[..., place] for one in zip(*each, strict=True)))


def with_landmarks(
    spread: Spread, data: Problems, rows: PostureRows, models: Sequence[AnyModel], problem: Int[np.ndarray, " folds"]
) -> Spread:
    """Add the numbers that landmark positions measure in the postures of each fold of a problem. Numbers that the
    person's set has measured are left out, because they may come from the same landmarks."""
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
    """Variation between the persons of a run, by model name, with which each person is adapted."""

    sds: OwnSDs
    """SDs by name that replace those of ``SIZES``. A dict, because it is sent to worker processes."""
    everybody: Mapping[str, Scales]
    """Scales learnt from all persons."""
    without: Mapping[str, Mapping[str, Scales]]
    """Scales by person, learnt without this person, for held-out predictions."""
    are_few: bool = False
    """True where the persons are too few to learn scales; each person's noise is then learnt alone."""
    unsure: Mapping[str, Unsure] = field(default_factory=dict)
    """Corrections of the covariance of sizes, without the axis ``problems``."""
    log_likelihood: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Log likelihood of every subject that the scales were learnt from."""

    def of(self, models: Sequence[AnyModel], subjects: Sequence[str], held_out: bool = False) -> list[Scales]:
        """Return the scales of every subject with every model."""
        found = []
        for model in models:
            everybody, without = self.everybody[model.name], self.without[model.name] if held_out else {}
            found += [without.get(person_of(subject), everybody) for subject in subjects]
        return found

    def unsure_of(self, models: Sequence[AnyModel], subjects: Sequence[str]) -> Unsure:
        """Return the covariance corrections of every subject with every model; zeros for few persons."""
        each = [self.unsure.get(model.name, Unsure(*np.zeros((2, len(GROUPS))))) for model in models]
        return Unsure(*(np.repeat(np.array(one).T, len(subjects), axis=1) for one in zip(*each, strict=True)))


class _Optimum(NamedTuple):
    """Girdles of some problems after at most thirty steps towards the posterior mode."""

    rows: Rows
    problem: Int[np.ndarray, " rows"]
    prior: Prior
    shares: Float[np.ndarray, "sizes n problems"]
    found: Posterior


def learn_people(rows: PostureRows, models: Sequence[AnyModel], sds: OwnSDs = NO_SDS, held_out: bool = True) -> People:
    """Learn the scales of each model from these subjects, or from a sample of many. For ``held_out`` folds, also learn
    them without each sixth of the persons."""
    chosen, sds = np.flatnonzero(np.isin(rows.subjects, sample(rows.subjects))), dict(sds)
    subjects = tuple(rows.subjects[k] for k in chosen.tolist())
    persons = [person_of(subject) for subject in subjects]
    different = list(dict.fromkeys(persons))
    everybody = dict.fromkeys((model.name for model in models), PRIOR)
    if len(different) < _FEWEST_PERSONS:
        return People(sds, everybody, {name: {} for name in everybody}, are_few=True)
    sixths = np.array_split(np.arange(len(different)), _GROUPS)
    number = {different[k]: g for g, sixth in enumerate(sixths) for k in sixth.tolist()}
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
    likelihood = {}
    for k, name in enumerate(everybody):
        mine = np.flatnonzero((of_model == k) & known)
        values = log_likelihoods(take_problems(of, mine), [scales[k]] * len(mine))
        likelihood[name] = dict(zip([subjects[i] for i in (mine % width).tolist()], values.tolist(), strict=True))
    if not held_out:
        return People(sds, everybody, {name: {} for name in everybody}, unsure=unsure, log_likelihood=likelihood)
    runs = (of_model == every[:, None, None]) & known & (np.tile(group, len(models)) != np.arange(_GROUPS)[:, None])
    each = _learnt_by_enough(of, runs.reshape(-1, len(known)), [one for one in scales for _ in range(_GROUPS)])
    without = {
        name: {person: each[_GROUPS * k + one] for person, one in zip(persons, group.tolist(), strict=True)}
        for k, name in enumerate(everybody)
    }
    return People(sds, everybody, without, unsure=unsure, log_likelihood=likelihood)


def _untold(at: _Optimum, known: Bool[np.ndarray, " problems"], models: int) -> Float[np.ndarray, "models groups"]:
    """Compute beta of each model and group over the problems that are ``known``."""
    more, told = (
        (IN_GROUP.T @ one).reshape(len(GROUPS), models, -1).sum(axis=2).T for one in overstated(*at, known, models)
    )
    return np.clip(more / np.where(told > 0.0, told, np.inf), 0.0, 1.0)


def _learnt_by_enough(of: Moments, runs: Bool[np.ndarray, "runs problems"], start: Sequence[Scales]) -> list[Scales]:
    """Learn the scales of each run; a run of too few problems keeps the scales of the prior."""
    found, enough = [PRIOR] * len(runs), np.flatnonzero(runs.sum(axis=1) >= _FEWEST).tolist()
    for k, one in zip(enough, learnt(of, runs[enough], [start[k] for k in enough]), strict=True):
        found[k] = one
    return found


def _variances_by_enough(of: Moments, runs: Bool[np.ndarray, "runs problems"], scales: Sequence[Scales]):
    """Compute the relative variances of the scales of each run; 0 for scales from the prior."""
    found, enough = np.zeros((len(runs), len(GROUPS))), np.flatnonzero(runs.sum(axis=1) >= _FEWEST)
    found[enough] = relative_variances(of, runs[enough], [scales[k] for k in enough.tolist()])
    return found


def with_own_noise(data: Problems, spread: Spread) -> list[Scales]:
    """Learn only the noise, for each problem alone.

    The distance of an unusual person from the set must not count as noise. So noise and scales are estimated together
    from this person, and the scales are then set to 1. Where the chain does not close with a noise, the noise is
    doubled.
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


def misfit(rows: PostureRows, model: AnyModel, people: People, noise_deg: float) -> tuple[float, int]:
    """Compute the misfit of all subjects with own bones (``scales.misfits``) and its degrees of freedom.

    Subjects whose chain does not close with this noise are left out; the misfit is infinite if none closes.
    """
    scales = [one._replace(noise_deg=noise_deg) for one in people.of([model], rows.subjects)]
    spread = spread_of([model], rows.subjects, people.sds)
    of, known = _moments(spread, _optimum(problems_of(rows, [model]), spread, scales))
    if not known.any():
        return np.inf, 1
    each = misfits(take_problems(of, known), [one for one, closed in zip(scales, known, strict=True) if closed])
    return float(each.sum()), int(of.informative[known].sum())


def sample(subjects: Sequence[str]) -> tuple[str, ...]:
    """Select the subjects that scales are learnt from; of many, evenly in the order of the files."""
    return one_in_so_many(subjects, _MOST_PERSONS)


def _optimum(data: Problems, spread: Spread, scales: Sequence[Scales]) -> _Optimum:
    rows, problem, _ = _rows_of(data)
    prior, shares = _prior(data, spread, scales)
    found = most_probable(rows, problem, prior, *staged(rows, problem, prior, STARTS_MM[0]), _LEARNING_STEPS)
    return _Optimum(rows, problem, prior, shares, found)


def _moments(spread: Spread, at: _Optimum) -> tuple[Moments, Bool[np.ndarray, " problems"]]:
    """Compute the moments, and for which problems the likelihood can be computed."""
    of = moments(of_chain(spread.columns_mm), at.prior, at.found, at.rows, at.problem)
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

    ``unsure``: corrections of the covariance of the sizes; by default none. ``kin``: number of the person, shared by
    problems with other postures of the same person; by default each problem is of another person.
    """
    rows, problem, posture = _rows_of(data)
    prior, shares = _prior(data, spread, scales)
    found = with_lowest_postures(rows, problem, prior, np.arange(len(scales)) if kin is None else kin)
    own, moved_mm = _own_bones(spread, scales, prior, shares, found, problem, unsure or Unsure.nothing(len(scales)))
    girdle = Girdle.of_numbers(np.asarray(data.girdle.numbers_mm) + moved_mm)
    data = replace(data, girdle=girdle)
    fitted = fit_batch(
        data.girdles_at(girdle.adapted_mm, posture, problem), rows.angles, rows.measured, found.nearest.angles
    )
    return data, _as_adapted(data, weight, found, fitted, (posture, problem)), own


def _rows_of(data: Problems) -> tuple[Rows, Int[np.ndarray, " rows"], Int[np.ndarray, " rows"]]:
    """Collect the postures that count, by problem, with the problem and the place of each."""
    problem, posture = np.nonzero(data.counted.T)
    angles, measured = (np.asarray(x)[:, posture, problem] for x in (data.angles, data.measured))
    return Rows(angles, measured, data.active_effects.at(posture, problem)), problem, posture


class _Sizes(NamedTuple):
    """Prior N(m, L L') of the sizes of each problem, in SDs, including landmarks but no angles."""

    mean: Float[np.ndarray, "problems sizes"]
    root: Float[np.ndarray, "problems sizes sizes"]


def _sizes(spread: Spread, scales: Sequence[Scales]) -> _Sizes:
    """Compute covariance (1 + J'W J)^-1 and mean (1 + J'W J)^-1 J'W more of the prior of the sizes.

    J is the Jacobian of the numbers that landmarks measure, W their precisions, ``more`` their excess over the set's.
    """
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
    """Compute the prior of the chain, and the map B' (R')^+ from u to the sizes L^-1 (z - m), with B = C L."""
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
    spread: Spread, scales: Sequence[Scales], prior: Prior, shares, found: Posterior, problem, unsure: Unsure
) -> tuple[OwnBones, Float[np.ndarray, "numbers problems"]]:
    """Compute the posterior of the sizes, and the change of the girdle by their means."""
    sd, shares, before = persons_first(spread.sd * _of_sizes(scales)), persons_first(shares), _sizes(spread, scales)
    S = before.root @ shares
    mean = before.mean + (S @ persons_first(found.u)[..., None])[..., 0]
    told = (S - S @ covariance_of_u(found, prior, problem)) @ np.swapaxes(S, 1, 2)
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
    several = np.append(np.arange(count), 0)  # numpy sums a single problem in another order
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
