"""The constants of adapt/diagnosis/inference/verdict.py that follow from the calibration cases of the withheld-effect
check.

The log odds of unknown from the whole ranking, with pairs; all else from none and single effects, before any pair, so
that cases of pairs and left-out effects do not count there.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from adapt.diagnosis.inference import verdict
from adapt.diagnosis.result import NONE
from models.effects import EFFECTS
from scripts.blind.cases import kind
from scripts.blind.report import rate
from scripts.blind.runs import Line
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
    kinds = np.array([kind(line["label"]) for line in whole])
    outside = kinds == "outside"
    single = np.isin(kinds, ("none", "effect"))
    if not outside.any() or not single.any():
        return "No calibration: it needs cases of calibration seeds with and without effects outside the list."
    tests = np.array([tests_in(line) for line in whole])
    weights = weights_of_tests(tests, outside)
    answered = unknown(tests, weights)
    labels = [NONE, *EFFECTS]
    listed = [line for line, alone in zip(whole, single, strict=True) if alone]
    log = np.nan_to_num(np.array([[line["ranking"][k] for k in labels] for line in listed], float), nan=-NO_EVIDENCE)
    truth = np.array([labels.index(line["label"]) for line in listed])
    log_prior = np.log([verdict._NONE_PRIOR, *[(1.0 - verdict._NONE_PRIOR) / len(EFFECTS)] * len(EFFECTS)])
    temperature = best_temperature(log, truth, log_prior)
    probabilities = tempered(log, log_prior, temperature)
    now = (*verdict._UNKNOWN_TERMS, *verdict._UNKNOWN_PENALTIES, verdict._TEMPERATURE)
    names = ("constant", "weight of the gain", "weight of the excess", "of pairs", "of the oversize", "temperature")
    fitted = [[n, f"{a:.3f}", f"{b:.3f}"] for n, a, b in zip(names, now, (*weights, temperature), strict=True)]
    seeds = sorted({line["seed"] for line in whole})
    return "\n\n".join(
        [
            f"From {len(whole)} simulated cases, seeds {seeds[0]} to {seeds[-1]}, of which {outside.sum()} outside "
            f"the list. Gain clipped at {verdict._MOST_GAIN:g}, excess at {verdict._MOST_EXCESS:g}.",
            markdown(["constant", "now", "fitted"], fitted),
            markdown(
                ["answered unknown, with the fitted terms", "share"],
                [[label, rate(answered[kinds == label].tolist())] for label in ("outside", "none", "effect", "pair")],
            ),
            markdown(
                ["NONE_FROM", "no effect: one blamed", "effect: none"],
                none_rows(probabilities, truth, ~answered[single]),
            ),
            markdown(["_SET_PROBABILITY", "effect in the set", "mean size"], set_rows(probabilities, truth)),
        ]
    )


def tests_in(line: Line) -> tuple[float, ...]:
    """What the log odds of unknown are linear in, as the verdict takes it, beside their constant."""
    tests = line["tests"]
    return *verdict.clipped_tests(tests["discrepancy_gain"], tests["excess"]), *tests["doubts"]


def weights_of_tests(x: Float[np.ndarray, "n k"], outside: Bool[np.ndarray, " n"]) -> Float[np.ndarray, " k+1"]:
    """Constant and weights of the log odds of being outside the list."""
    ridge = np.r_[0.0, np.full(x.shape[1], RIDGE)]
    return logistic(np.column_stack([np.ones(len(x)), x]), outside, ridge)


def logistic(
    X: Float[np.ndarray, "n k"], hit: Bool[np.ndarray, " n"], ridge: Float[np.ndarray, " k"]
) -> Float[np.ndarray, " k"]:
    """Weights of the log odds: Newton's method, steps halved where they go too far."""
    y = hit.astype(float)

    def cost(w: np.ndarray) -> float:
        t = X @ w
        return float((np.logaddexp(0.0, t) - y * t).sum() + 0.5 * (ridge * w**2).sum())

    w = np.zeros(X.shape[1])
    for _ in range(_STEPS):
        p = 1.0 / (1.0 + np.exp(-X @ w))
        curvature = (X * (p * (1.0 - p))[:, None]).T @ X + np.diag(ridge)
        step = np.linalg.solve(curvature, X.T @ (y - p) - ridge * w)
        while cost(w + step) > cost(w) and np.abs(step).max() > _SETTLED:
            step *= 0.5
        w = w + step
        if np.abs(step).max() <= _SETTLED:
            break
    return w


def unknown(x: Float[np.ndarray, "n k"], weights: Float[np.ndarray, " k+1"]) -> Bool[np.ndarray, " n"]:
    """Where 'unknown' is the answer."""
    odds = verdict.UNKNOWN_FROM / (1.0 - verdict.UNKNOWN_FROM)
    return weights[0] + x @ weights[1:] >= math.log(odds)


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


def none_rows(probabilities: np.ndarray, truth: np.ndarray, known: np.ndarray) -> list[list[str]]:
    """Blame on no effect and effects missed, for each threshold."""
    rows = []
    for kept in NONE_FROM:
        blamed, missed = known & (probabilities[:, 0] < kept), known & (probabilities[:, 0] >= kept)
        rows.append([f"{kept:g}", rate(blamed[truth == 0].tolist()), rate(missed[truth > 0].tolist())])
    return rows


def set_rows(probabilities: np.ndarray, truth: np.ndarray) -> list[list[str]]:
    """Whether the set of effects holds the one at work, and its mean size, for each threshold."""
    effects = probabilities[truth > 0, 1:] / probabilities[truth > 0, 1:].sum(axis=1, keepdims=True)
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
