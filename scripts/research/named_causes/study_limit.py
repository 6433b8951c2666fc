"""How many single causes could be named at all? An observer who knows the effect, against people who differ.

For the worlds of the blind check (`synthetic_a`), with its own chain, in NumPy. The observer knows the effect in every
posture of every subject; unknown is only whether the effect is active, or the subjects' six parameters differ from the
set's in a way that looks like it. Without noise, with S the SDs of people,

    d^2 = min sum (measured - closed)^2 / noise^2 + sum |(theta_s - set) / S - h|^2 + |h|^2   over postures, theta and h

without the effect, less the same with it. With noise, the log odds of the effect are then N(d^2 / 2, d^2); it is named
where they exceed ``LEAST``.

A second observer knows the form, but not the size: k numbers, as many as the library's candidate has, with a prior of
variance v = d^2 / k each, in SDs of their estimates x. The log odds are then

    sum x^2 v / (2 (1 + v)) - k / 2 log(1 + v),   sum x^2 noncentral chi-square: k degrees of freedom, noncentrality d^2

A diagnosis has to find the form besides, and the noise and how much people differ.

    python scripts/research/named_causes/study_limit.py --seeds 50:55
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import typer
from scipy.stats import ncx2, norm

ROOT = Path(__file__).parents[3]
sys.path[:0] = [str(ROOT)]

from models.adapted_parameters import PERSON_SD_MM  # noqa: E402
from models.effects import EFFECTS  # noqa: E402
from scripts.reporting import markdown  # noqa: E402
from scripts.research.named_causes.blind.cases import CONDITIONS, LISTED, SHOWN_MOTIONS, Case, world_seed  # noqa: E402
from scripts.research.named_causes.synthetic_a.catalogue import draw_effect  # noqa: E402
from scripts.research.named_causes.synthetic_a.chain import Chain, read_chain  # noqa: E402
from scripts.research.named_causes.synthetic_a.conventions import DEG, Array, Index, Mask  # noqa: E402
from scripts.research.named_causes.synthetic_a.courses import Change  # noqa: E402
from scripts.research.named_causes.synthetic_a.subjects import lay_out, with_parameters  # noqa: E402
from scripts.research.named_causes.synthetic_a.world import (  # noqa: E402
    ELEVATIONS_DEG,
    LANDMARK_NOISE_MM,
    close_subjects,
    measure,
)

LEAST = float(np.log(0.8 / 0.2) - np.log(2.0 / 22.0))
"""Least log odds: posterior odds of four to one, with two of 22 causes expected a priori."""

_STEP_MM, _STEP_RAD = 1e-4, 1e-6
"""Steps of the central differences."""

_STEPS, _ENOUGH, _STUCK = 80, 1e-3, 1e4


class Observed(NamedTuple):
    """Noise-free measurements of a world."""

    chain_at: Callable[[Array], Chain]
    """Chain as a function of the parameters of every subject (s, 6), mm from the set's."""
    true_mm: Array
    subject: Index
    kept: Mask
    """Mask of the postures that closed."""
    angles: Array
    places_mm: Array
    """Positions of SC, AC, TS, AI (n, 4, 3)."""
    sd_rad: float
    sd_mm: float
    """SD of the positions; infinite without landmarks."""


def observed(case: Case) -> tuple[Observed, Observed, Change]:
    """Make the noise-free world of a case: as measured, and as an observer sees it who subtracts the effect's influence
    on the measurement."""
    how = CONDITIONS[case.condition]
    seed = world_seed(case)
    postures = lay_out(how.subjects, SHOWN_MOTIONS, ELEVATIONS_DEG)
    _, base = read_chain(ROOT / "models" / "sets" / f"{case.model}.toml", len(postures.subject))
    change, _ = draw_effect(case.label, postures, how.size, seed, how.mixed_sign)
    people, _, chain, q, _, open_ = close_subjects(base, postures, [change], seed)
    angles, places = measure(chain, q, [change])

    def chain_at(theta_mm: Array) -> Chain:
        return with_parameters(base, replace(people, parameter_mm=theta_mm), postures)

    sd_mm = LANDMARK_NOISE_MM if how.landmarks else np.inf
    shown = Observed(
        chain_at, people.parameter_mm, postures.subject, ~open_, angles, np.stack(places, 1), how.noise_deg * DEG, sd_mm
    )
    true = shown._replace(angles=q, places_mm=np.stack(chain.points(q), 1))
    return shown, true, change


def distance2(shown: Observed, change: Change | None) -> float:
    """Minimise the sum of squares by damped Gauss-Newton steps from the truth. change: the active effect, if any."""

    def chain_at(theta_mm: Array) -> Chain:
        chain = shown.chain_at(theta_mm)
        return chain if change is None else change.chain(chain)

    theta, damping = shown.true_mm, 1e-3
    h = (theta / PERSON_SD_MM).sum(axis=0) / (len(theta) + 1.0)
    q, _ = chain_at(theta).close(shown.angles)
    now, rows, slopes, q = _at(shown, chain_at, theta, h, q)
    for _ in range(_STEPS):
        dtheta, dh = _step(shown, theta, h, rows, slopes, damping)
        tried = _at(shown, chain_at, theta + dtheta, h + dh, q)
        if not tried[0] < now:  # also where tried[0] is NaN
            damping *= 8.0
            if damping > _STUCK:
                break
            continue
        gain, theta, h, damping = now - tried[0], theta + dtheta, h + dh, max(damping / 4.0, 1e-6)
        now, rows, slopes, q = tried
        if gain < _ENOUGH:
            break
    return now


def _at(
    shown: Observed, chain_at: Callable[[Array], Chain], theta: Array, h: Array, q: Array
) -> tuple[float, Array, Array, Array]:
    """Compute the sum of squares, and each posture's residuals and their derivatives in theta.

    The posture angles are projected out of both.
    """
    chain = chain_at(theta)
    by_theta = np.stack(
        [
            (chain_at(theta + one).gap(q)[0] - chain_at(theta - one).gap(q)[0]) / (2.0 * _STEP_MM)
            for one in _STEP_MM * np.eye(6)
        ],
        -1,
    )
    rows = slopes = np.zeros(0)
    for _ in range(4):
        gap, G = chain.gap(q)
        inverse, free = np.linalg.pinv(G), np.swapaxes(np.linalg.svd(G)[2][:, 3:], 1, 2)
        back, along = -(inverse @ gap[..., None])[..., 0], -inverse @ by_theta
        J = _slopes(shown, chain, q)
        left = _left(shown, chain, q) - (J @ back[..., None])[..., 0]
        basis, inner = np.linalg.qr(J @ free)
        across = np.swapaxes(basis, 1, 2)
        rows = left - (basis @ (across @ left[..., None]))[..., 0]
        slopes = J @ along - basis @ (across @ (J @ along))
        q = q + back + (free @ np.linalg.solve(inner, across @ left[..., None]))[..., 0]
    people = theta / PERSON_SD_MM - h
    return float((rows[shown.kept] ** 2).sum() + (people**2).sum() + h @ h), rows, slopes, q


def _left(shown: Observed, chain: Chain, q: Array) -> Array:
    """Return the residuals measured - simulated, in SDs (n, 18)."""
    places = (shown.places_mm - np.stack(chain.points(q), 1)) / shown.sd_mm
    return np.concatenate([(shown.angles - q) / shown.sd_rad, places.reshape(len(q), -1)], 1)


def _slopes(shown: Observed, chain: Chain, q: Array) -> Array:
    """Return the derivatives of the simulated measurements in the angles (n, 18, 6)."""
    every = [
        (np.stack(chain.points(q + one), 1) - np.stack(chain.points(q - one), 1)) / (2.0 * _STEP_RAD * shown.sd_mm)
        for one in _STEP_RAD * np.eye(6)
    ]
    of_angles = np.tile(np.eye(6) / shown.sd_rad, (len(q), 1, 1))
    return np.concatenate([of_angles, np.stack(every, -1).reshape(len(q), -1, 6)], 1)


def _step(shown: Observed, theta: Array, h: Array, rows: Array, slopes: Array, damping: float) -> tuple[Array, Array]:
    """Solve the damped linear least-squares problem: eliminate theta of each subject, then solve for h."""
    W = np.diag(1.0 / PERSON_SD_MM)
    total, right, each = np.eye(6), -h, []
    for s in range(len(theta)):
        own = (shown.subject == s) & shown.kept
        A, b, apart = slopes[own].reshape(-1, 6), rows[own].ravel(), theta[s] / PERSON_SD_MM - h
        K, v = A.T @ A + W @ W, A.T @ b - W @ apart
        inverse = np.linalg.inv(K + damping * np.diag(np.diag(K)))
        total, right = total + np.eye(6) - W @ inverse @ W, right + apart + W @ inverse @ v
        each.append((inverse, v))
    dh = np.linalg.inv(total) @ right
    return np.stack([inverse @ (v + W @ dh) for inverse, v in each]), dh


def separation2(case: Case) -> float:
    """Compute d^2 of the world of a case."""
    shown, true, change = observed(case)
    return distance2(shown, None) - distance2(true, change)


def could_be_named(d2: float) -> float:
    """Compute the probability that the log odds exceed ``LEAST``."""
    return float(norm.cdf((d2 / 2.0 - LEAST) / np.sqrt(max(d2, 1e-9))))


def could_be_named_without_size(d2: float, numbers: int) -> float:
    """Compute the probability that the log odds exceed ``LEAST`` where the size has so many unknown numbers."""
    v = d2 / numbers
    least = (2.0 * LEAST + numbers * np.log1p(v)) * (1.0 + v) / max(v, 1e-9)
    return float(ncx2.sf(least, numbers, d2))


def main(seeds: str = "50:55") -> None:
    """Print d^2 of every label, and the share that could be named, with angles alone and with landmarks."""
    first, end = map(int, seeds.split(":"))
    table = []
    for label in LISTED:
        row = [label]
        for condition in ("two_motions", "landmarks"):
            found = [separation2(Case(condition, label, seed)) for seed in range(first, end)]
            numbers = len(EFFECTS[label].prior.scale)
            known = np.mean([could_be_named(one) for one in found])
            unknown = np.mean([could_be_named_without_size(one, numbers) for one in found])
            row += [" ".join(f"{one:.0f}" for one in found), f"{known:.2f}", f"{unknown:.2f}"]
        table.append(row)
        print(*row, flush=True)
    means = [f"{np.mean([float(row[k]) for row in table]):.2f}" for k in (2, 3, 5, 6)]
    of_condition = ["could be named", "size unknown"]
    names = ["cause", "d^2, angles", *of_condition, "d^2, landmarks", *of_condition]
    print(markdown(names, [*table, ["mean", "", *means[:2], "", *means[2:]]]))


if __name__ == "__main__":
    typer.run(main)
