"""Does a diagnosis of measured shoulders depend on the last tenth of a degree? Its names with a little noise added.

Each parameter set diagnoses the motions as they are, and again with noise whose SD is far below the measurement error.
For every two of these diagnoses: the share of first names that both have, among those that either has; and the mean
difference of the inclusion probabilities. Without any influence of the noise these would be 1 and 0.
"""

import argparse
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from rich.console import Console
from rich.progress import track

from adapt.diagnosis import diagnose
from adapt.diagnosis.result import Verdict
from models import ParameterSet, load_model
from motions import Motions
from scripts.reporting import bone_pins, markdown

NOISE_DEG = 0.1
TIMES = 3
"""SD of the added noise, and number of draws."""


def main() -> None:
    """Diagnose the motions with each set, as they are and with noise; print one table."""
    described = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    motions, options = bone_pins(described)
    rows = []
    for name in track(options.model, console=Console(stderr=True)):
        found = list(verdicts(motions, load_model(name)))
        rows.append([name, "; ".join(", ".join(first_names(one)) for one in found), *compared(found)])
    print(markdown(["parameter set", "first names, as it is; with noise", "alike", "at work differs"], rows))


def verdicts(motions: Motions, model: ParameterSet) -> Iterator[Verdict]:
    """Diagnose the motions as they are, then with each new draw of noise."""
    angles = motions.angles_deg
    draws = (np.random.default_rng(seed).standard_normal(angles.shape) for seed in range(1, TIMES + 1))
    for noise in (0.0, *draws):
        yield diagnose(replace(motions, angles_deg=angles + NOISE_DEG * noise), model)[model.name].verdict


def first_names(verdict: Verdict) -> list[str]:
    """Return the first name of each cause."""
    return [cause.names[0] for cause in verdict.causes]


def compared(found: Sequence[Verdict]) -> tuple[str, str]:
    """Average over pairs of diagnoses: share of common first names, and difference of inclusion probabilities."""
    pairs = list(combinations(found, 2))
    shared = [share(first_names(one), first_names(other)) for one, other in pairs]
    apart = [abs(one.inclusion[name] - other.inclusion[name]) for one, other in pairs for name in one.inclusion]
    return f"{np.mean(shared):.2f}", f"{np.mean(apart):.3f}"


def share(one: Collection[str], other: Collection[str]) -> float:
    """Divide the number of common names by the number of names in either; 1 where both are empty."""
    either = set(one) | set(other)
    return len(set(one) & set(other)) / len(either) if either else 1.0


if __name__ == "__main__":
    main()
