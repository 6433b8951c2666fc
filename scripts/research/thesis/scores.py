"""Distance of an adaptation of R2, R4 and R6 from the published one: five scores, each 0 for the thesis.

SD      rms over set and parameter of ln(SD / SD of Table 6.5), each SD over subjects and at least 0.5 mm
shift   rms of (mean shift from the set's own parameters - shift from Table 6.6 to 6.5) / SD of Table 6.5
gap     rms over set and angle of ln(r / r of the thesis), r = mean gap after / before (Tables 6.1-6.4)
A_z     |ln| of the range of the sets' mean A_z after adaptation, relative to the thesis: 6 mm (from 19)
cells   |share of set, subject and angle whose gap shrinks - 0.70|
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from adapt.trust.thesis import printed
from models.adapted_parameters import ADAPTED
from scripts.research.thesis.outcomes import Outcome

LEAST_MM = 0.5
"""Half of the last printed digit: below it, ratios of SDs or ranges are meaningless."""

TERMS = ("SD", "shift", "gap", "A_z", "cells")

RESAMPLES = 1000


ALL, WITHOUT_CONOID = slice(None), slice(0, ADAPTED.index("conoid_length"))
"""Parameters that count in the first two scores."""


def scores(found: Mapping[str, Outcome], among: slice = ALL) -> Float[np.ndarray, " terms"]:
    """Compute the five scores, in the order of TERMS."""
    sets = [found[name] for name in printed.SETS]
    sd = np.maximum([one.sd_mm for one in sets], LEAST_MM)
    shift = np.array([one.shift_mm.mean(axis=1) for one in sets])
    published = printed.adapted_mm() - printed.own_mm()
    return np.array(
        [
            rms(np.log(sd / printed.sd_mm())[:, among]),
            rms(((shift - published) / printed.sd_mm())[:, among]),
            rms(np.log(gap_ratios(sets) / published_gap_ratios())),
            abs(np.log(a_z_range_mm(sets) / published_a_z_range_mm())),
            abs(shrunk(sets) - published_shrunk()),
        ]
    )


def gap_ratios(sets: list[Outcome]) -> Float[np.ndarray, "sets angles"]:
    """Compute the ratio of mean gaps, after / before, over the subjects."""
    return np.array([one.after_deg.mean(axis=1) / one.before_deg.mean(axis=1) for one in sets])


def published_gap_ratios() -> Float[np.ndarray, "sets angles"]:
    """Compute the ratio of mean gaps of Tables 6.1-6.4."""
    return printed.gaps_deg(adapted=True).mean(axis=2) / printed.gaps_deg(adapted=False).mean(axis=2)


def a_z_range_mm(sets: list[Outcome]) -> float:
    """Compute the largest less the smallest mean A_z of the sets."""
    return max(LEAST_MM, float(np.ptp([one.theta_mm[ADAPTED.index("A_z")].mean() for one in sets])))


def published_a_z_range_mm() -> float:
    """Compute the range of mean A_z of Table 6.5."""
    return float(np.ptp(printed.adapted_mm()[:, ADAPTED.index("A_z")]))


def shrunk(sets: list[Outcome]) -> float:
    """Compute the share of set, subject and angle whose gap shrinks."""
    return float(np.mean([one.after_deg < one.before_deg for one in sets]))


def published_shrunk() -> float:
    """Compute the share of the 180 cells of Tables 6.1-6.4 whose gap shrinks."""
    return float((printed.gaps_deg(adapted=True) < printed.gaps_deg(adapted=False)).mean())


def complete(found: Mapping[str, Outcome]) -> dict[str, Outcome]:
    """Select the subjects that every set was adapted to."""
    ok = np.all([one.ok for one in found.values()], axis=0)
    return {name: one.take(ok) for name, one in found.items()}


def beats(one: Mapping[str, Outcome], other: Mapping[str, Outcome]) -> float:
    """Compute the share of bootstrap resamples of the subjects in which ``one`` has the lower sum of scores.

    Both outcomes have the same subjects. Resamples with a single person are left out, since they have no SD.
    """
    generator = np.random.default_rng(6)
    count = len(next(iter(one.values())).ok)
    draws = [np.array(draw) for draw in generator.integers(count, size=(RESAMPLES, count)) if len(set(draw)) > 1]
    lower = [total(one, draw) < total(other, draw) for draw in draws]
    return float(np.mean(lower))


def total(found: Mapping[str, Outcome], subjects: np.ndarray) -> float:
    """Compute the sum of the five scores over some subjects."""
    return float(scores({name: found[name].take(subjects) for name in printed.SETS}).sum())


def rms(values: np.ndarray) -> float:
    """Compute the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
