"""The constants of adapt/diagnosis/verdict.py that follow from the calibration cases of the withheld-effect check.

All but the last two from the ranking of none and single effects, before any pair: pairs and left-out effects do not
count. The last two, what makes a hypothesis hard to believe, from the whole ranking, with pairs and given the others.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Bool, Float

from adapt.diagnosis import verdict
from adapt.diagnosis.verdict import NONE
from models.effects import EFFECTS
from scripts.blind_report import Line, kind, rate
from scripts.reporting import markdown

NONE_FROM = (0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5)
SET_PROBABILITY = (0.8, 0.9, 0.95, 0.97, 0.98, 0.99, 0.995)
TEMPERATURES = np.geomspace(0.2, 50.0, 1000)
"""Half a percent apart."""

RIDGE = 1e-2
"""On the weights of the logistic regressions: keeps them finite where the classes do not overlap."""

NO_EVIDENCE = 1e6
"""In nats, below the best: where a fit failed and the evidence is no number."""

_STEPS = 100
_SETTLED = 1e-10


def calibration(lines: Sequence[Line]) -> str:
    """The fitted constants and what follows from them, as Markdown."""
    whole = [line for line in lines if "failed" not in line and line["condition"] != "loo"]
    good = [line for line in whole if kind(line["label"]) != "pair"]
    listed = [line for line in good if kind(line["label"]) != "outside"]
    if not 0 < len(listed) < len(good):
        return "No calibration: it needs cases of calibration seeds with and without effects outside the list."
    features = np.array([tests_in(line) for line in good])
    outside = np.array([kind(line["label"]) == "outside" for line in good])
    terms = terms_of_tests(features, outside)
    labels = [NONE, *EFFECTS]
    log = np.nan_to_num(np.array([[line["ranking"][k] for k in labels] for line in listed], float), nan=-NO_EVIDENCE)
    truth = np.array([labels.index(line["label"]) for line in listed])
    log_prior = np.log([verdict._NONE_PRIOR, *[(1.0 - verdict._NONE_PRIOR) / len(EFFECTS)] * len(EFFECTS)])
    temperature = best_temperature(log, truth, log_prior)
    shares = tempered(log, log_prior, temperature)
    known = ~unknown(features[~outside], terms)
    now = (*verdict._UNKNOWN_TERMS, verdict._TEMPERATURE, *verdict._DOUBTS)
    names = ("constant", "weight of the gain", "weight of the excess", "temperature", "of pairs", "of the oversize")
    then = (*terms, temperature, *weights_of_doubts(whole))
    fitted = [[n, f"{a:.3f}", f"{b:.3f}"] for n, a, b in zip(names, now, then, strict=True)]
    seeds = sorted({line["seed"] for line in good})
    return "\n\n".join(
        [
            f"From {len(good)} simulated cases, seeds {seeds[0]} to {seeds[-1]}, of which {outside.sum()} outside "
            f"the list. Gain clipped at {verdict._MOST_GAIN:g}, excess at {verdict._MOST_EXCESS:g}.",
            markdown(["constant", "now", "fitted"], fitted),
            markdown(
                ["answered unknown, with the fitted terms", "share"],
                [
                    ["outside", rate(unknown(features[outside], terms).tolist())],
                    ["no effect", rate((~known[truth == 0]).tolist())],
                    ["effect", rate((~known[truth > 0]).tolist())],
                ],
            ),
            markdown(["NONE_FROM", "no effect: one blamed", "effect: none"], none_rows(shares, truth, known)),
            markdown(["_SET_PROBABILITY", "effect in the set", "mean size"], set_rows(shares, truth)),
        ]
    )


def terms_of_tests(x: Float[np.ndarray, "n 2"], outside: Bool[np.ndarray, " n"]) -> tuple[float, float, float]:
    """Constant and weights of the log odds of being outside the list."""
    constant, *weights = logistic(np.column_stack([np.ones(len(x)), x]), outside, np.array([0.0, RIDGE, RIDGE]))
    return float(constant), float(weights[0]), float(weights[1])


def weights_of_doubts(lines: Sequence[Line]) -> Float[np.ndarray, " 2"]:
    """Of pairs and of the oversize, beside the terms as they are now."""
    tests = [line["tests"] for line in lines]
    constant, *weights = verdict._UNKNOWN_TERMS
    known = constant + np.array([tests_in(of) for of in tests]) @ np.array(weights)
    outside = np.array([kind(line["label"]) == "outside" for line in lines])
    return logistic(np.array([of["doubts"] for of in tests]), outside, RIDGE * np.ones(2), known)


def tests_in(of: Mapping[str, float]) -> tuple[float, float]:
    """Discrepancy gain and excess, as the verdict takes them."""
    return verdict.clipped_tests(of["discrepancy_gain"], of["excess"])


def logistic(
    X: Float[np.ndarray, "n k"],
    hit: Bool[np.ndarray, " n"],
    ridge: Float[np.ndarray, " k"],
    known: float | Float[np.ndarray, " n"] = 0.0,
) -> Float[np.ndarray, " k"]:
    """Weights of the log odds, beside what is known of these: Newton's method, steps halved where they go too far."""
    y = hit.astype(float)

    def cost(w: np.ndarray) -> float:
        t = known + X @ w
        return float((np.logaddexp(0.0, t) - y * t).sum() + 0.5 * (ridge * w**2).sum())

    w = np.zeros(X.shape[1])
    for _ in range(_STEPS):
        p = 1.0 / (1.0 + np.exp(-known - X @ w))
        curvature = (X * (p * (1.0 - p))[:, None]).T @ X + np.diag(ridge)
        step = np.linalg.solve(curvature, X.T @ (y - p) - ridge * w)
        while cost(w + step) > cost(w) and np.abs(step).max() > _SETTLED:
            step *= 0.5
        w = w + step
        if np.abs(step).max() <= _SETTLED:
            break
    return w


def unknown(x: Float[np.ndarray, "n 2"], terms: tuple[float, float, float]) -> Bool[np.ndarray, " n"]:
    """Where 'unknown' is the answer."""
    odds = verdict.UNKNOWN_FROM / (1.0 - verdict.UNKNOWN_FROM)
    return terms[0] + x @ np.array(terms[1:]) >= math.log(odds)


def tempered(
    log: Float[np.ndarray, "n k"], log_prior: Float[np.ndarray, " k"], temperature: float
) -> Float[np.ndarray, "n k"]:
    """Probabilities from log evidence."""
    t = log / temperature + log_prior
    p = np.exp(t - t.max(axis=1, keepdims=True))
    return p / p.sum(axis=1, keepdims=True)


def best_temperature(log: Float[np.ndarray, "n k"], truth: np.ndarray, log_prior: Float[np.ndarray, " k"]) -> float:
    """The temperature that makes the truth most probable."""
    rows = np.arange(len(truth))

    def likelihood(temperature: float) -> float:
        t = log / temperature + log_prior
        return float((t[rows, truth] - np.logaddexp.reduce(t, axis=1)).sum())

    return float(max(TEMPERATURES, key=likelihood))


def none_rows(shares: np.ndarray, truth: np.ndarray, known: np.ndarray) -> list[list[str]]:
    """Blame on no effect and effects missed, for each threshold."""
    rows = []
    for kept in NONE_FROM:
        blamed, missed = known & (shares[:, 0] < kept), known & (shares[:, 0] >= kept)
        rows.append([f"{kept:g}", rate(blamed[truth == 0].tolist()), rate(missed[truth > 0].tolist())])
    return rows


def set_rows(shares: np.ndarray, truth: np.ndarray) -> list[list[str]]:
    """Whether the set of effects holds the one at work, and its mean size, for each threshold."""
    effects = shares[truth > 0, 1:] / shares[truth > 0, 1:].sum(axis=1, keepdims=True)
    order = np.argsort(-effects, axis=1, kind="stable")
    before = np.cumsum(np.take_along_axis(effects, order, axis=1), axis=1)
    before -= np.take_along_axis(effects, order, axis=1)
    place = np.argmax(order == truth[truth > 0, None] - 1, axis=1)
    rows = []
    for held in SET_PROBABILITY:
        sizes = (before < held).sum(axis=1)
        size = f"{sizes.mean():.2f}" if len(sizes) else "-"
        rows.append([f"{held:g}", rate((place < sizes).tolist()), size])
    return rows
