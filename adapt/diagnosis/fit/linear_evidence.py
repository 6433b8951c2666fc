"""How well each hypothesis explains the gap of all subjects together: evidence with everything else integrated out.

A hypothesis is a set of effects at work. In subject s, linear around the most probable parameters,

    y_s = X_s u_s + A_s a_s + noise,   u_s ~ N(0, 1),   a_s = c mu + b delta_s,   mu, delta_s ~ N(0, 1)

with u the adapted parameters and a the amplitudes, both in prior standard deviations about the model's own: every
subject has parameters of its own, and amplitudes that vary (b) about a common one (c). All integrals are Gaussian, so
the evidence is closed form; per subject only two sufficient statistics of the amplitudes are left, and subjects combine
by adding them.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from models.adapted_parameters import PRIOR_SD_MM

Hypothesis = tuple[str, ...]
"""Names of the effects at work; empty for none."""


def single_hypotheses(names: Iterable[str]) -> list[Hypothesis]:
    """That nothing is at work, and each effect alone."""
    return [(), *((name,) for name in names)]


_ADAPTED = len(PRIOR_SD_MM)

_TURNS = 3
"""Rounds of turning signs: the eigenvector is nearly always right."""

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
    """Amplitudes that vary little between subjects."""
    return AmplitudePrior(0.0 * scale, scale, BETWEEN_SUBJECTS * scale)


def independent_prior(scale: Float[np.ndarray, " amplitudes"]) -> AmplitudePrior:
    """Amplitudes that every subject has for itself, of either sign."""
    return AmplitudePrior(0.0 * scale, 0.0 * scale, np.sqrt(1.0 + BETWEEN_SUBJECTS**2) * scale)


def common_shift(share: float) -> AmplitudePrior:
    """Adapted parameters that are off by the same in all subjects (see ``InnerProducts.with_shift``): the people
    measured are not on average the person whose girdle the parameter set is. ``share`` is that of their SD between
    people."""
    nothing = np.zeros(_ADAPTED)
    return AmplitudePrior(nothing, nothing + share, nothing)


Spread = Callable[[Float[np.ndarray, " amplitudes"]], AmplitudePrior]
"""alike or unlike."""


@dataclass(frozen=True)
class LinearisedFit:
    """A hypothesis fitted to all subjects, linear around its most probable parameters (see ``most_probable``)."""

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

    def with_noise(self, share: float) -> "LinearisedFit":
        """The same, had the noise been ``share`` times what it was taken for."""
        changed = {name: getattr(self, name) / share for name in ("y", "X", "A", "linear", "root", "by_angle")}
        return replace(self, **changed)

    def with_spread(self, spread: Float[np.ndarray, " 6"]) -> "LinearisedFit":
        """The same with other spreads of the adapted parameters."""
        share = spread / self.spread
        return replace(self, X=share * self.X, u=self.u / share, spread=spread)


@dataclass(frozen=True)
class Posterior:
    """What follows from the linear model with one prior of the amplitudes."""

    log_evidence: float
    common: Float[np.ndarray, " amplitudes"]
    """Mean of the common amplitude."""
    covariance: Float[np.ndarray, "amplitudes amplitudes"]
    """Of the common amplitude."""
    u: Float[np.ndarray, "subjects 6"]
    """Means of the adapted parameters, in prior standard deviations."""
    a: Float[np.ndarray, "subjects amplitudes"]
    """Means of each subject's amplitudes."""
    mean_covariance: Float[np.ndarray, "amplitudes amplitudes"]
    """Of the mean of a over these subjects."""


@dataclass(frozen=True)
class Statistics:
    """What is left of the subjects once their adapted parameters are integrated out: of one data set or many draws,
    with one noise and spread or, along first axes, several."""

    log: Float[np.ndarray, "*draws"]
    """Log evidence with all amplitudes 0."""
    information: Float[np.ndarray, "*draws subjects amplitudes amplitudes"]
    """Where it is the same for all draws, along axes of length 1."""
    pull: Float[np.ndarray, "*draws subjects amplitudes"]

    def project(self, T: Float[np.ndarray, "*draws amplitudes fewer"]) -> "Statistics":
        """The same of the fewer amplitudes b that these, a = T b, are made of."""
        T = T[..., None, :, :]
        pull = (self.pull[..., None, :] @ T)[..., 0, :]
        return replace(self, information=np.swapaxes(T, -1, -2) @ self.information @ T, pull=pull)

    def with_signs(self, sign: Float[np.ndarray, "*draws subjects"]) -> "Statistics":
        """The same of amplitudes whose sign is turned where ``sign`` is -1."""
        return replace(self, pull=self.pull * sign[..., None])


@dataclass(frozen=True)
class InnerProducts:
    """Inner products over a subject's residuals: all that evidence needs of them, whatever the noise and the spread."""

    columns: Float[np.ndarray, "subjects columns columns"]
    """Of X, A and what is beside A with each other."""
    seen: Float[np.ndarray, "*draws subjects columns"]
    """Of them with what was seen (``linear``)."""
    square: Float[np.ndarray, "*draws"]
    """Of what was seen with itself, summed over subjects."""
    residuals: int
    """How many there are, of all subjects."""
    spread: Float[np.ndarray, " 6"] = field(default_factory=lambda: np.ones(_ADAPTED))
    """That X is for."""

    def at(
        self,
        noise_share: float | Float[np.ndarray, "*first"] = 1.0,
        spread: Float[np.ndarray, "*first 6"] | None = None,
    ) -> Statistics:
        """What is left once the adapted parameters are integrated out; of several noises and spreads along first axes.

        From (1 + X X')^-1 = 1 - X (1 + X'X)^-1 X' and det(1 + X X') = det(1 + X'X): 6x6 in place of residuals squared.
        """
        share, draws = np.asarray(noise_share), self.square.ndim
        wider = (self.spread if spread is None else spread) / self.spread
        first = np.broadcast_shapes(share.shape, wider.shape[:-1])
        unit = np.ones((*first, self.columns.shape[1])) / share[..., None]
        unit[..., :_ADAPTED] *= wider
        columns = self.columns * (unit[..., :, None] * unit[..., None, :])[..., None, :, :]
        behind_draws = (slice(None),) * len(first) + (None,) * draws
        share, unit = np.broadcast_to(share, first)[behind_draws], unit[behind_draws]
        seen = self.seen * (unit / share[..., None])[..., None, :]
        root = np.linalg.cholesky(np.eye(_ADAPTED) + columns[..., :_ADAPTED, :_ADAPTED])
        away = np.linalg.inv(root)
        through = away @ columns[..., :_ADAPTED, _ADAPTED:]
        own = (away[behind_draws] @ seen[..., :_ADAPTED, None])[..., 0]
        log = -0.5 * (self.square / share**2 - (own**2).sum(axis=(-1, -2)))
        information = columns[..., _ADAPTED:, _ADAPTED:] - np.swapaxes(through, -1, -2) @ through
        volume = np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=(-1, -2))
        return Statistics(
            log=log - volume[behind_draws],
            information=information[behind_draws],
            pull=seen[..., _ADAPTED:] - (own[..., None, :] @ through[behind_draws])[..., 0, :],
        )

    def of_adapted(self, amplitudes: Float[np.ndarray, "subjects amplitudes"]) -> "InnerProducts":
        """Those of X alone, had these amplitudes been known."""
        by_amplitudes, seen = self.columns[:, _ADAPTED:], self.seen[:, _ADAPTED:]
        both = np.einsum("skl,sk->sl", by_amplitudes, amplitudes)
        explained = (amplitudes * (2.0 * seen - both[:, _ADAPTED:])).sum()
        own = slice(None, _ADAPTED)
        seen = self.seen[:, own] - both[:, own]
        return replace(self, columns=self.columns[:, own, own], seen=seen, square=self.square - explained)

    def with_shift(self) -> "InnerProducts":
        """The same with X once more behind all columns, in units of ``PRIOR_SD_MM``: what a shift of the adapted
        parameters does that all subjects have in common."""
        again = np.concatenate([np.arange(self.columns.shape[1]), np.arange(_ADAPTED)])
        unit = np.ones(len(again))
        unit[-_ADAPTED:] /= self.spread
        columns = self.columns[:, again[:, None], again] * np.outer(unit, unit)
        return replace(self, columns=columns, seen=self.seen[..., again] * unit)

    def over(
        self, shares: Sequence[tuple[float, float]], spreads: Float[np.ndarray, "spreads 6"] | None = None
    ) -> Statistics:
        """The same, along a first axis, for each of ``spreads``, where given; then for each share of the noise that may
        be all of it, its probability included: the evidences add up."""
        share, probability = np.transpose(shares)
        of = self.at(share, None if spreads is None else spreads[:, None])
        more = np.log(probability) - self.residuals * np.log(share)
        return replace(of, log=of.log + more.reshape(-1, *(1,) * self.square.ndim))


def inner_products(
    fitted: LinearisedFit, extra: Float[np.ndarray, "subjects residuals more"] | None = None
) -> InnerProducts:
    """Inner products of a fitted hypothesis; ``extra`` are further columns beside its own."""
    more = () if extra is None else (extra,)
    columns = np.concatenate([fitted.X, fitted.A, *more], axis=2)
    return InnerProducts(
        columns=np.swapaxes(columns, 1, 2) @ columns,
        seen=np.einsum("src,sr->sc", columns, fitted.linear),
        square=np.asarray((fitted.linear**2).sum()),
        residuals=int(np.count_nonzero(fitted.y)),
        spread=fitted.spread,
    )


def statistics(fitted: LinearisedFit) -> Statistics:
    """Sufficient statistics of the amplitudes."""
    return inner_products(fitted).at()


def log_evidence(of: Statistics, prior: AmplitudePrior) -> Float[np.ndarray, "*draws"]:
    """log p(y | hypothesis) but for a constant that all hypotheses on the same data share."""
    return _combined(of, prior)[0]


def common_amplitude(
    of: Statistics, prior: AmplitudePrior, along: Float[np.ndarray, "*draws amplitudes ways"] | None = None
) -> tuple[
    Float[np.ndarray, "*draws"],
    Float[np.ndarray, "*draws amplitudes"],
    Float[np.ndarray, "*draws amplitudes amplitudes"],
]:
    """Log evidence, and mean and covariance of the common amplitude.

    ``along``: ways that each subject's amplitudes may differ beside the prior's deviations, in standard deviations.
    """
    return _combined(of, prior, along)[:3]


def agreeing_signs(of: Statistics, prior: AmplitudePrior) -> Float[np.ndarray, "*draws subjects"]:
    """Signs of the subjects' amplitudes with which all agree best on a common one.

    The evidence grows with s'Qs, Q = p C p' from each subject's pull p on the common amplitude and its covariance C:
    the signs s start as those of Q's largest eigenvector; each is then turned as long as that adds.
    """
    by_subject = _subject_information(of, prior)
    Q = by_subject.pull @ by_subject.covariance @ np.swapaxes(by_subject.pull, -1, -2)
    sign = np.where(np.linalg.eigh(Q)[1][..., -1] < 0.0, -1.0, 1.0)
    own = np.diagonal(Q, axis1=-2, axis2=-1)
    for _ in range(_TURNS):
        for k in range(sign.shape[-1]):
            with_others = (Q[..., k, :] * sign).sum(axis=-1) - own[..., k] * sign[..., k]
            sign[..., k] = np.where(sign[..., k] * with_others < 0.0, -sign[..., k], sign[..., k])
    return sign


def log_sum(logs: Sequence[np.ndarray] | Sequence[float] | np.ndarray, axis: int = 0) -> Float[np.ndarray, "*draws"]:
    """log of the sum of the exponentials, over an axis."""
    return np.logaddexp.reduce(np.asarray(logs), axis=axis)


@dataclass(frozen=True)
class _SubjectInformation:
    """What each subject says of the common amplitude, its own deviation integrated out."""

    own: Float[np.ndarray, "*draws subjects amplitudes amplitudes"]
    """The shrinkage b S b' of each subject's deviation."""
    log: Float[np.ndarray, "*draws"]
    """Log evidence with the common amplitude at its prior mean."""
    pull: Float[np.ndarray, "*draws subjects amplitudes"]
    """On the common amplitude, in its prior standard deviations."""
    covariance: Float[np.ndarray, "*draws amplitudes amplitudes"]
    """Of it, in the same."""


def _subject_information(of: Statistics, prior: AmplitudePrior, along=None) -> _SubjectInformation:
    c, mean = prior.common, prior.mean
    information, pull = of.information, of.pull - of.information @ mean
    b = _deviations(prior.between, along)
    S = np.linalg.inv(np.eye(b.shape[-1]) + np.swapaxes(b, -1, -2) @ information @ b)
    own = b @ S @ np.swapaxes(b, -1, -2)
    followed = np.einsum("...sij,...sj->...si", own, pull)
    log = of.log + 0.5 * (of.pull + pull).sum(axis=-2) @ mean
    log = log + 0.5 * (pull * followed).sum(axis=(-1, -2)) + 0.5 * np.linalg.slogdet(S)[1].sum(axis=-1)
    left = (information - information @ own @ information).sum(axis=-3)
    covariance = np.linalg.inv(np.eye(len(c)) + c[:, None] * left * c)
    return _SubjectInformation(
        own, log, c * (pull - np.einsum("...sij,...sj->...si", information, followed)), covariance
    )


def _deviations(between, along) -> Float[np.ndarray, "*draws 1 amplitudes ways"]:
    """b with b b' the covariance of a subject's deviation from the common amplitude."""
    each = np.diag(between)[:, between > 0.0]
    if along is not None:
        each = np.concatenate([np.broadcast_to(each, (*along.shape[:-1], each.shape[1])), along], axis=-1)
    return each[..., None, :, :]


def _combined(of: Statistics, prior: AmplitudePrior, along=None):
    """Log evidence; mean and covariance of the common amplitude; the shrinkage b S b' of each subject."""
    by_subject, c = _subject_information(of, prior, along), prior.common
    pull, covariance = by_subject.pull.sum(axis=-2), by_subject.covariance
    mu = np.einsum("...i,...ij->...j", pull, covariance)
    log = by_subject.log + 0.5 * (pull * mu).sum(axis=-1) + 0.5 * np.linalg.slogdet(covariance)[1]
    return log, prior.mean + c * mu, c[:, None] * covariance * c, by_subject.own


def posterior(fitted: LinearisedFit, prior: AmplitudePrior) -> Posterior:
    """Evidence and means of everything under one prior of the amplitudes."""
    of = statistics(fitted)
    log, common, covariance, own = _combined(of, prior)
    left = of.pull - np.einsum("sij,j->si", of.information, common)
    a = common + np.einsum("sij,sj->si", own, left)
    rest = fitted.linear - np.einsum("srk,sk->sr", fitted.A, a)
    XX = np.swapaxes(fitted.X, 1, 2) @ fitted.X + np.eye(fitted.X.shape[2])
    u = np.linalg.solve(XX, np.einsum("srk,sr->sk", fitted.X, rest)[..., None])[..., 0]
    follows = np.eye(len(common)) - (own @ of.information).mean(axis=0)
    mean_covariance = follows @ covariance @ follows.T + own.sum(axis=0) / len(own) ** 2
    return Posterior(float(log), common, covariance, u, a, mean_covariance)
