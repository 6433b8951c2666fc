# pyright: reportOptionalMemberAccess=false, reportAttributeAccessIssue=false, reportArgumentType=false
"""Corrections of the intervals of bones: straight and curved ridges, and scales that few persons determine poorly."""

from types import SimpleNamespace

import numpy as np
import pytest
from own_people import NOISE_DEG, R2, adapted, people, simulated

from adapt.own_bones.own_adaptation import People, learn_people
from adapt.own_bones.scales import IN_GROUP, SCALE_SD, Moments, Scales, learnt, relative_variances
from adapt.own_bones.unsure import Unsure
from adapt.solvers.rows import posture_rows
from models import load_model
from models.person.own_bones import GROUPS, SIZES
from motions import Motions

NOTHING = np.zeros(len(GROUPS))

GROUP = np.array([GROUPS.index(one.group) for one in SIZES])


@pytest.fixture(scope="module")
def twice() -> SimpleNamespace:
    """Sixty persons whose bones and frames differ twice as much as people do."""
    return simulated(60, 2.0, seed=11)


def untold(motions: Motions, *models) -> np.ndarray:
    """Return the untold fractions of R2."""
    return learn_people(posture_rows(motions, {}), models or [R2], held_out=False).unsure["R2"].untold


def unsure(share=NOTHING, scale_variance=NOTHING) -> dict:
    return {"R2": Unsure(np.array(share), np.array(scale_variance))}


def test_a_share_that_is_not_told_is_the_prior_s():
    """Check the covariance against C + r (1 - C) r in units of the sizes, with a different fraction for each group.

    A fraction of 1 gives the prior variance.
    """
    motions = simulated(3).motions
    known, own = people(), adapted(motions).problems.own_bones
    share = np.array([0.0, 0.36, 1.0])
    less = adapted(motions, People({}, known.everybody, known.without, unsure=unsure(share))).problems.own_bones
    np.testing.assert_array_equal(less.sizes, own.sizes)
    prior = np.einsum("ij,jp->ijp", np.eye(len(SIZES)), own.prior_sd**2)
    r = np.sqrt(share)[GROUP]
    expected = own.covariance + r[:, None, None] * (prior - own.covariance) * r[:, None]
    np.testing.assert_allclose(less.covariance, expected, atol=1e-9)
    np.testing.assert_allclose(less.sd[GROUP == 2], own.prior_sd[GROUP == 2], rtol=1e-9)


def test_a_scale_that_is_unsure_makes_the_prior_s_part_unsure():
    """Check the covariance against C + C D C in units of the prior; sizes, ``told`` and ``distance`` stay the same."""
    motions = simulated(3).motions
    known, own = people(), adapted(motions).problems.own_bones
    variance = np.array([0.1, 0.0, 0.2])
    less = adapted(motions, People({}, known.everybody, known.without, unsure=unsure(NOTHING, variance)))
    less = less.problems.own_bones
    for name in ("sizes", "told", "distance"):
        np.testing.assert_array_equal(getattr(less, name), getattr(own, name))
    sd = own.prior_sd[:, None] * own.prior_sd
    C = own.covariance / sd
    np.testing.assert_allclose(less.covariance / sd, C + np.einsum("ijp,j,jkp->ikp", C, variance[GROUP], C), atol=1e-12)


def test_the_variance_of_scales_is_that_of_normal_numbers():
    """Check the relative variance of a scale against 1 / 2 n, for n numbers seen without noise, with the scale's prior.

    The variance is larger with noise as large as the numbers, and for persons who do not differ.
    """
    generator, persons = np.random.default_rng(3), 40
    n = len(SIZES)
    numbers = persons * np.bincount(GROUP)
    z = generator.standard_normal((n, persons))
    z *= np.sqrt(numbers / (IN_GROUP.T @ (z**2)).sum(axis=1))[GROUP, None]  # their sample SD is exactly 1

    def variances(factor, noise_deg):
        b = factor * z + noise_deg * generator.standard_normal((n, persons))
        more = noise_deg * generator.standard_normal((9 * n, persons))  # independent of sizes: determines the noise
        square, every = (b**2).sum(axis=0) + (more**2).sum(axis=0), np.ones((1, persons), bool)
        of = Moments(np.repeat(np.eye(n)[..., None], persons, axis=-1), b, square, np.full(persons, 10 * n))
        return relative_variances(of, every, learnt(of, every, [Scales()]))[0]

    expected = 1.0 / (2.0 * numbers + 1.0 / SCALE_SD**2)
    np.testing.assert_allclose(variances(1.0, 0.05), expected, rtol=0.02)
    assert (variances(1.0, 1.0) > 2.0 * expected).all()
    assert (variances(0.0, 1.0) > 0.1).all()


def test_ridges_of_persons_who_hardly_differ_are_straight():
    """Check that little is untold: the chain is linear over a fiftieth of people's variation, so that draws move the
    optimum as the Jacobian says."""
    found = untold(simulated(20, 0.0, noise_deg=0.1, seed=12).motions)
    assert found[1:].max() < 0.02


def test_curved_ridges_tell_less(twice):
    """Check the untold fractions of a set, which stay the same beside another set."""
    alone = untold(twice.motions)
    assert (alone > 0.08).all()
    assert (alone < 0.7).all()
    np.testing.assert_allclose(untold(twice.motions, load_model("breteler_dissection"), R2), alone, rtol=1e-6)


def test_of_few_persons_nothing_is_known_of_it():
    few = simulated(9, 2.0).motions
    found = learn_people(posture_rows(few, {}), [R2])
    assert found.are_few
    np.testing.assert_array_equal(found.unsure_of([R2], few.subjects), np.zeros((2, len(GROUPS), len(few.subjects))))


def test_intervals_of_persons_who_differ_twice_as_much_hold(twice):
    """Check the coverage of intervals of bones and frames with the true scales: too low with the linearised
    covariance."""
    inside = {}
    scales = {"R2": Scales(1.0, 2.0, 2.0, NOISE_DEG)}
    for word, share in (("slopes", NOTHING), ("ridges", untold(twice.motions))):
        own = adapted(twice.motions, People({}, scales, {"R2": {}}, unsure=unsure(share))).problems.own_bones
        close = np.abs(own.sizes - twice.sizes) <= 1.96 * own.sd
        inside[word] = [close[k == GROUP].mean() for k in (1, 2)]
    assert min(inside["slopes"]) < 0.925
    assert 0.925 < min(inside["ridges"]) <= max(inside["ridges"]) < 0.98, inside  # 95 %, known to 1 %
