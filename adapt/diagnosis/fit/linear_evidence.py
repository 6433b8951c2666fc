"""How well each hypothesis explains the gap of all subjects together: evidence with everything else integrated out.

A hypothesis is a set of effects at work. In subject s, linear around the most probable parameters,

    y_s = X_s u_s + A_s a_s + noise,   u_s ~ N(0, 1),   a_s = c mu + b delta_s,   mu, delta_s ~ N(0, 1)

with u the adapted parameters and a the amplitudes, both in prior standard deviations about the model's own: every
subject has parameters of its own, and amplitudes that vary (b) about a common one (c). All integrals are Gaussian, so
the evidence is closed form; per subject only two sufficient statistics of the amplitudes are left, and subjects combine
by adding them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.linear_model import AmplitudePrior, LinearisedFit
from models.adapted_parameters import ADAPTED

_ADAPTED = len(ADAPTED)

_TURNS = 3
"""Rounds of turning signs: the eigenvector is nearly always right."""


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
class AmplitudeStatistics:
    """What is left of the subjects once their adapted parameters are integrated out: of one data set or many draws,
    with one noise and spread or, along first axes, several."""

    log: Float[np.ndarray, "*draws"]
    """Log evidence with all amplitudes 0."""
    information: Float[np.ndarray, "*draws subjects amplitudes amplitudes"]
    """Where it is the same for all draws, along axes of length 1."""
    gradient: Float[np.ndarray, "*draws subjects amplitudes"]
    """Of the log evidence by the amplitudes, where they are 0."""

    def project(self, T: Float[np.ndarray, "*draws amplitudes fewer"]) -> "AmplitudeStatistics":
        """Change to the fewer amplitudes b that these, a = T b, are made of."""
        T = T[..., None, :, :]
        gradient = (self.gradient[..., None, :] @ T)[..., 0, :]
        return replace(self, information=np.swapaxes(T, -1, -2) @ self.information @ T, gradient=gradient)

    def with_signs(self, sign: Float[np.ndarray, "*draws subjects"]) -> "AmplitudeStatistics":
        """Turn the sign of the amplitudes where ``sign`` is -1."""
        return replace(self, gradient=self.gradient * sign[..., None])


@dataclass(frozen=True)
class InnerProducts:
    """Inner products over a subject's residuals: all that evidence needs of them, whatever the noise and the spread."""

    columns: Float[np.ndarray, "subjects columns columns"]
    """Of X, A and what is beside A with each other."""
    with_data: Float[np.ndarray, "*draws subjects columns"]
    """Of them with the data (``linear``)."""
    square: Float[np.ndarray, "*draws"]
    """Of the data with themselves, summed over subjects."""
    residuals: int
    """How many there are, of all subjects."""
    spread: Float[np.ndarray, " 6"] = field(default_factory=lambda: np.ones(_ADAPTED))
    """That X is for."""

    def at(
        self,
        noise_factor: float | Float[np.ndarray, "*first"] = 1.0,
        spread: Float[np.ndarray, "*first 6"] | None = None,
    ) -> AmplitudeStatistics:
        """Integrate the adapted parameters out, for one noise and spread or several along first axes.

        From (1 + X X')^-1 = 1 - X (1 + X'X)^-1 X' and det(1 + X X') = det(1 + X'X): 6x6 in place of residuals squared.
        """
        factor, draws = np.asarray(noise_factor), self.square.ndim
        wider = (self.spread if spread is None else spread) / self.spread
        first = np.broadcast_shapes(factor.shape, wider.shape[:-1])
        unit = np.ones((*first, self.columns.shape[1])) / factor[..., None]
        unit[..., :_ADAPTED] *= wider
        columns = self.columns * (unit[..., :, None] * unit[..., None, :])[..., None, :, :]
        behind_draws = (slice(None),) * len(first) + (None,) * draws
        factor, unit = np.broadcast_to(factor, first)[behind_draws], unit[behind_draws]
        with_data = self.with_data * (unit / factor[..., None])[..., None, :]
        root = np.linalg.cholesky(np.eye(_ADAPTED) + columns[..., :_ADAPTED, :_ADAPTED])
        away = np.linalg.inv(root)
        through = away @ columns[..., :_ADAPTED, _ADAPTED:]
        own = (away[behind_draws] @ with_data[..., :_ADAPTED, None])[..., 0]
        log = -0.5 * (self.square / factor**2 - (own**2).sum(axis=(-1, -2)))
        information = columns[..., _ADAPTED:, _ADAPTED:] - np.swapaxes(through, -1, -2) @ through
        volume = np.log(np.diagonal(root, axis1=-2, axis2=-1)).sum(axis=(-1, -2))
        return AmplitudeStatistics(
            log=log - volume[behind_draws],
            information=information[behind_draws],
            gradient=with_data[..., _ADAPTED:] - (own[..., None, :] @ through[behind_draws])[..., 0, :],
        )

    def given_amplitudes(self, amplitudes: Float[np.ndarray, "subjects amplitudes"]) -> "InnerProducts":
        """Reduce to the inner products of X alone, as if these amplitudes had been known."""
        by_amplitudes, with_data = self.columns[:, _ADAPTED:], self.with_data[:, _ADAPTED:]
        both = np.einsum("skl,sk->sl", by_amplitudes, amplitudes)
        explained = (amplitudes * (2.0 * with_data - both[:, _ADAPTED:])).sum()
        own = slice(None, _ADAPTED)
        with_data = self.with_data[:, own] - both[:, own]
        return replace(self, columns=self.columns[:, own, own], with_data=with_data, square=self.square - explained)

    def with_shift(self) -> "InnerProducts":
        """Add X once more behind all columns, in units of ``PRIOR_SD_MM``: what a shift of the adapted parameters does
        that all subjects have in common."""
        again = np.concatenate([np.arange(self.columns.shape[1]), np.arange(_ADAPTED)])
        unit = np.ones(len(again))
        unit[-_ADAPTED:] /= self.spread
        columns = self.columns[:, again[:, None], again] * np.outer(unit, unit)
        return replace(self, columns=columns, with_data=self.with_data[..., again] * unit)

    def over(
        self, noise_factors: Sequence[tuple[float, float]], spreads: Float[np.ndarray, "spreads 6"] | None = None
    ) -> AmplitudeStatistics:
        """Integrate the adapted parameters out, along a first axis, for each of ``spreads``, where given; then for each
        factor of the noise, its probability included: the evidences add up."""
        factor, probability = np.transpose(noise_factors)
        statistics = self.at(factor, None if spreads is None else spreads[:, None])
        more = np.log(probability) - self.residuals * np.log(factor)
        return replace(statistics, log=statistics.log + more.reshape(-1, *(1,) * self.square.ndim))


def inner_products(
    fitted: LinearisedFit, extra: Float[np.ndarray, "subjects residuals more"] | None = None
) -> InnerProducts:
    """Compute the inner products of a fitted hypothesis; ``extra`` are further columns beside its own."""
    more = () if extra is None else (extra,)
    columns = np.concatenate([fitted.X, fitted.A, *more], axis=2)
    return InnerProducts(
        columns=np.swapaxes(columns, 1, 2) @ columns,
        with_data=np.einsum("src,sr->sc", columns, fitted.linear),
        square=np.asarray((fitted.linear**2).sum()),
        residuals=int(np.count_nonzero(fitted.y)),
        spread=fitted.spread,
    )


def amplitude_statistics(fitted: LinearisedFit) -> AmplitudeStatistics:
    """Compute the sufficient statistics of the amplitudes, at the noise and the spread of the fit."""
    return inner_products(fitted).at()


def log_evidence(statistics: AmplitudeStatistics, prior: AmplitudePrior) -> Float[np.ndarray, "*draws"]:
    """Compute log p(y | hypothesis) but for a constant that all hypotheses on the same data share."""
    return _combined(statistics, prior)[0]


def common_amplitude(
    statistics: AmplitudeStatistics,
    prior: AmplitudePrior,
    along: Float[np.ndarray, "*draws amplitudes ways"] | None = None,
) -> tuple[
    Float[np.ndarray, "*draws"],
    Float[np.ndarray, "*draws amplitudes"],
    Float[np.ndarray, "*draws amplitudes amplitudes"],
]:
    """Compute the log evidence, and the mean and covariance of the common amplitude.

    ``along``: ways that each subject's amplitudes may differ beside the prior's deviations, in standard deviations.
    """
    return _combined(statistics, prior, along)[:3]


def agreeing_signs(statistics: AmplitudeStatistics, prior: AmplitudePrior) -> Float[np.ndarray, "*draws subjects"]:
    """Find the signs of the subjects' amplitudes with which all agree best on a common one.

    The evidence grows with s'Qs, Q = p C p' from each subject's gradient p by the common amplitude and the covariance
    C of that: the signs s start as those of Q's largest eigenvector; each is then turned as long as that adds.
    """
    by_subject = _subject_information(statistics, prior)
    Q = by_subject.gradient @ by_subject.covariance @ np.swapaxes(by_subject.gradient, -1, -2)
    sign = np.where(np.linalg.eigh(Q)[1][..., -1] < 0.0, -1.0, 1.0)
    own = np.diagonal(Q, axis1=-2, axis2=-1)
    for _ in range(_TURNS):
        for k in range(sign.shape[-1]):
            with_others = (Q[..., k, :] * sign).sum(axis=-1) - own[..., k] * sign[..., k]
            sign[..., k] = np.where(sign[..., k] * with_others < 0.0, -sign[..., k], sign[..., k])
    return sign


def log_sum(logs: Sequence[np.ndarray] | Sequence[float] | np.ndarray, axis: int = 0) -> Float[np.ndarray, "*draws"]:
    """Compute the log of the sum of the exponentials, over an axis."""
    return np.logaddexp.reduce(np.asarray(logs), axis=axis)


@dataclass(frozen=True)
class _SubjectInformation:
    """What each subject says of the common amplitude, its own deviation integrated out."""

    own: Float[np.ndarray, "*draws subjects amplitudes amplitudes"]
    """The shrinkage b S b' of each subject's deviation."""
    log: Float[np.ndarray, "*draws"]
    """Log evidence with the common amplitude at its prior mean."""
    gradient: Float[np.ndarray, "*draws subjects amplitudes"]
    """By the common amplitude, in its prior standard deviations."""
    covariance: Float[np.ndarray, "*draws amplitudes amplitudes"]
    """Of it, in the same."""


def _subject_information(statistics: AmplitudeStatistics, prior: AmplitudePrior, along=None) -> _SubjectInformation:
    c, mean = prior.common, prior.mean
    information, gradient = statistics.information, statistics.gradient - statistics.information @ mean
    b = _deviations(prior.between, along)
    S = np.linalg.inv(np.eye(b.shape[-1]) + np.swapaxes(b, -1, -2) @ information @ b)
    own = b @ S @ np.swapaxes(b, -1, -2)
    followed = np.einsum("...sij,...sj->...si", own, gradient)
    log = statistics.log + 0.5 * (statistics.gradient + gradient).sum(axis=-2) @ mean
    log = log + 0.5 * (gradient * followed).sum(axis=(-1, -2)) + 0.5 * np.linalg.slogdet(S)[1].sum(axis=-1)
    left = (information - information @ own @ information).sum(axis=-3)
    covariance = np.linalg.inv(np.eye(len(c)) + c[:, None] * left * c)
    return _SubjectInformation(
        own, log, c * (gradient - np.einsum("...sij,...sj->...si", information, followed)), covariance
    )


def _deviations(between, along) -> Float[np.ndarray, "*draws 1 amplitudes ways"]:
    """b with b b' the covariance of a subject's deviation from the common amplitude."""
    each = np.diag(between)[:, between > 0.0]
    if along is not None:
        each = np.concatenate([np.broadcast_to(each, (*along.shape[:-1], each.shape[1])), along], axis=-1)
    return each[..., None, :, :]


def _combined(statistics: AmplitudeStatistics, prior: AmplitudePrior, along=None):
    """Log evidence; mean and covariance of the common amplitude; the shrinkage b S b' of each subject."""
    by_subject, c = _subject_information(statistics, prior, along), prior.common
    gradient, covariance = by_subject.gradient.sum(axis=-2), by_subject.covariance
    mu = np.einsum("...i,...ij->...j", gradient, covariance)
    log = by_subject.log + 0.5 * (gradient * mu).sum(axis=-1) + 0.5 * np.linalg.slogdet(covariance)[1]
    return log, prior.mean + c * mu, c[:, None] * covariance * c, by_subject.own


def posterior(fitted: LinearisedFit, prior: AmplitudePrior) -> Posterior:
    """Compute the evidence and the means of everything under one prior of the amplitudes."""
    statistics = amplitude_statistics(fitted)
    log, common, covariance, own = _combined(statistics, prior)
    left = statistics.gradient - np.einsum("sij,j->si", statistics.information, common)
    a = common + np.einsum("sij,sj->si", own, left)
    rest = fitted.linear - np.einsum("srk,sk->sr", fitted.A, a)
    XX = np.swapaxes(fitted.X, 1, 2) @ fitted.X + np.eye(fitted.X.shape[2])
    u = np.linalg.solve(XX, np.einsum("srk,sr->sk", fitted.X, rest)[..., None])[..., 0]
    follows = np.eye(len(common)) - (own @ statistics.information).mean(axis=0)
    mean_covariance = follows @ covariance @ follows.T + own.sum(axis=0) / len(own) ** 2
    return Posterior(float(log), common, covariance, u, a, mean_covariance)
