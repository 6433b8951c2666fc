"""Reasons why a probable cause is not named."""

from collections.abc import Mapping

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.inference.computed_axial_rotation import is_its_zero
from adapt.diagnosis.inference.selection import LEAST_PROBABILITY

NOT_NEEDED = "the causes that are named do without it"
OWN_BONES_DO = "own bones predict held-out motions as well"
UNEXPLAINED = "all persons share a misfit that no listed cause explains, so this cause is not trusted"
CONTRADICTED = "angles contradict the landmarks, so this cause is not trusted"
OF_ESTIMATE = "a computed axial rotation has a zero of its own"
PERSONS_DIFFER = "persons differ in it by as much as they have in common"


def why_not_named(
    inclusion: Mapping[str, float],
    causes: Mapping[str, str],
    named: Hypothesis,
    kept: Hypothesis,
    constants: Hypothesis,
    doubt: str,
    known: Hypothesis = (),
) -> dict[str, str]:
    """Return the reason against each cause that is probably active but not named.

    ``causes``: cause of each effect; ``named`` and ``kept``: causes before and after the test against own bones;
    ``constants``: the named causes that are the same in every posture; ``doubt``: why no cause is trusted, or empty;
    ``known``: causes known to be active.
    """
    before, after, same = ({causes[name] for name in names} for names in (named, kept, constants))
    found = {}
    for cause, probability in inclusion.items():
        if probability < LEAST_PROBABILITY or cause in after:
            continue
        if is_its_zero(cause, known):
            found[cause] = OF_ESTIMATE
        elif doubt:
            found[cause] = doubt
        elif cause in before:
            found[cause] = PERSONS_DIFFER if cause in same else OWN_BONES_DO
        else:
            found[cause] = NOT_NEEDED
    return found
