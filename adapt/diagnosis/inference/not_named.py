"""Why a probable cause is not named."""

from collections.abc import Mapping

from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.inference.selection import LEAST_PROBABILITY, Named

NOT_NEEDED = "the causes that are named do without it"
PREDICTS_WORSE = "with it unseen postures are predicted worse"
OWN_BONES_DO = "bones of each person's own predict unseen motions as well"
LEFT_OVER = "beside it all persons do something alike that no cause of the list explains"
PERSONS_DIFFER = "persons differ in it by as much as they have in common"


def why_not_named(
    inclusion: Mapping[str, float],
    causes: Mapping[str, str],
    named: Named,
    kept: Hypothesis,
    constants: Hypothesis,
    unexplained: bool,
) -> dict[str, str]:
    """Say of each cause that is probably at work and not named what speaks against it.

    ``causes``: of the effects; ``named``: before, ``kept``: after they were held against bones of each person's own;
    ``constants``: which of them are the same in every posture; ``unexplained``: the best set is rejected.
    """
    of = {word: {causes[name] for name in names} for word, names in _stages(named, kept).items()}
    found = {}
    for cause, probability in inclusion.items():
        if probability < LEAST_PROBABILITY or cause in of["kept"]:
            continue
        if unexplained:
            found[cause] = LEFT_OVER
        elif cause in of["named"]:
            found[cause] = PERSONS_DIFFER if cause in {causes[name] for name in constants} else OWN_BONES_DO
        else:
            found[cause] = PREDICTS_WORSE if cause in of["chosen"] else NOT_NEEDED
    return found


def _stages(named: Named, kept: Hypothesis) -> dict[str, Hypothesis]:
    return {"chosen": named.chosen.hypothesis, "named": named.hypothesis, "kept": kept}
