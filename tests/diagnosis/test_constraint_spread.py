"""Size of constraint violations at the measured postures: cases by hand, and the noise by automatic derivatives."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from programs import one_run

from adapt.diagnosis.location.constraint_spread import ConstraintSpread, constraint_spread
from adapt.diagnosis.location.observations import Observed, observe
from adapt.solvers.rows import posture_rows
from models import load_model
from models.girdle import CONSTRAINTS, Girdle
from motions.rhythm_subjects import shipped_subjects
from motions.rotations import DEG

ROUNDING_MM = 1e-9
"""Rounding of a difference between two distances."""

SLOPES = 1e-9
"""Relative tolerance for derivatives through the same geometry in two ways."""

NOISE_DEG = 1.5


@pytest.fixture(scope="module")
def data() -> Observed:
    """The shipped (simulated) subjects."""
    return observe(shipped_subjects(), posture_rows(shipped_subjects()))


@pytest.fixture(scope="module")
def chain(data: Observed) -> Girdle:
    """R2 without adaptation, for each subject."""
    girdle = jax.tree.map(np.asarray, load_model("R2").girdle)
    return girdle.repeated(len(data.subjects)).over_postures()


def spread(data: Observed, *chains: Girdle) -> list[ConstraintSpread]:
    """Compute the spread of an adapted chain and of one with causes, with ``NOISE_DEG``."""
    adapted, with_causes = chains
    return constraint_spread(data, adapted, with_causes, NOISE_DEG)


def test_a_longer_conoid_takes_its_length_off_a3(data: Observed, chain: Girdle) -> None:
    residuals = np.asarray(chain.residuals_mm(data.angles))[:, data.measured.all(axis=0)]
    longer = replace(chain, conoid_length_mm=chain.conoid_length_mm + 5.0)
    found = spread(data, chain, longer)
    assert [one.constraint for one in found] == list(CONSTRAINTS)
    assert [one.adapted_mm for one in found] == pytest.approx(np.sqrt((residuals**2).mean(axis=1)), abs=ROUNDING_MM)
    for one in found[:2]:
        assert one.with_causes_mm == pytest.approx(one.adapted_mm, abs=ROUNDING_MM)
    assert found[2].with_causes_mm == pytest.approx(np.sqrt(((residuals[2] - 5.0) ** 2).mean()), abs=ROUNDING_MM)


def test_noise_goes_through_the_slopes(data: Observed, chain: Girdle) -> None:
    rows = np.argwhere(data.measured.all(axis=0))[:20]
    chosen = np.zeros(data.measured.shape, bool)
    chosen[:, *rows.T] = True
    few = replace(data, measured=chosen)
    plain = load_model("R2").girdle
    slopes = one_run(jax.vmap(jax.jacfwd(plain.residuals_mm)))(np.stack([data.angles[:, p, s] for p, s in rows]))
    expected = np.sqrt((np.asarray(slopes) ** 2).sum(axis=2).mean(axis=0)) * NOISE_DEG / DEG
    found = [one.noise_mm for one in spread(few, chain, chain)]
    assert found == pytest.approx(np.asarray(expected), rel=SLOPES)


def test_without_a_whole_posture_there_is_none(data: Observed, chain: Girdle) -> None:
    measured = data.measured.copy()
    measured[2] = False
    assert spread(replace(data, measured=measured), chain, chain) == []
