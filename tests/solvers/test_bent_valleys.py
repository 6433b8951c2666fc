# pyright: reportOptionalMemberAccess=false, reportAttributeAccessIssue=false, reportArgumentType=false
"""What motions tell of bones, less what slopes overstate: straight and bent valleys, and the intervals with it."""

from types import SimpleNamespace

import numpy as np
import pytest
from own_people import NOISE_DEG, R2, adapted, people, simulated

from adapt.own_bones.own_adaptation import People, learn_people
from adapt.own_bones.scales import Scales
from adapt.solvers.rows import posture_rows
from models import load_model
from models.person.own_bones import GROUPS, SIZES
from motions import Motions

GROUP = np.array([GROUPS.index(one.group) for one in SIZES])


@pytest.fixture(scope="module")
def twice() -> SimpleNamespace:
    """Sixty persons whose bones and frames differ twice as much as people do."""
    return simulated(60, 2.0, seed=11)


def untold(motions: Motions, *models) -> dict:
    return dict(learn_people(posture_rows(motions, {}), models or [R2], held_out=False).untold)


def test_a_share_that_is_not_told_is_the_prior_s():
    """C + r (1 - C) r, in the units of the sizes: the prior's for 1, of two groups that differ between them."""
    motions = simulated(3).motions
    known, own = people(), adapted(motions).problems.own_bones
    share = np.array([0.0, 0.36, 1.0])
    less = adapted(motions, People({}, known.everybody, known.without, untold={"R2": share})).problems.own_bones
    np.testing.assert_array_equal(less.sizes, own.sizes)
    prior = np.einsum("ij,jp->ijp", np.eye(len(SIZES)), own.prior_sd**2)
    r = np.sqrt(share)[GROUP]
    expected = own.covariance + r[:, None, None] * (prior - own.covariance) * r[:, None]
    np.testing.assert_allclose(less.covariance, expected, atol=1e-9)
    np.testing.assert_allclose(less.sd[GROUP == 2], own.prior_sd[GROUP == 2], rtol=1e-9)


def test_valleys_of_persons_who_hardly_differ_are_straight():
    """The chain is linear over a fiftieth of how people differ, and draws move the optimum as the slopes say."""
    found = untold(simulated(20, 0.0, noise_deg=0.1, seed=12).motions)["R2"]
    assert found[1:].max() < 0.02


def test_bent_valleys_tell_less(twice):
    """And the same of a set alone as beside another."""
    alone = untold(twice.motions)["R2"]
    assert (alone > 0.08).all()
    assert (alone < 0.7).all()
    np.testing.assert_allclose(untold(twice.motions, load_model("breteler_dissection"), R2)["R2"], alone, rtol=1e-6)


def test_of_few_persons_nothing_is_known_of_it():
    few = simulated(9, 2.0).motions
    found = learn_people(posture_rows(few, {}), [R2])
    assert found.are_few
    np.testing.assert_array_equal(found.untold_of([R2], few.subjects), np.zeros((len(GROUPS), len(few.subjects))))


def test_intervals_of_persons_who_differ_twice_as_much_hold(twice):
    """Of bones and frames, with the scales as they are: without what valleys do not tell they are too small."""
    inside = {}
    scales = {"R2": Scales(1.0, 2.0, 2.0, NOISE_DEG)}
    for word, untold_there in (("slopes", {}), ("valleys", untold(twice.motions))):
        own = adapted(twice.motions, People({}, scales, {"R2": {}}, untold=untold_there)).problems.own_bones
        close = np.abs(own.sizes - twice.sizes) <= 1.96 * own.sd
        inside[word] = [close[k == GROUP].mean() for k in (1, 2)]
    assert min(inside["slopes"]) < 0.925
    assert 0.925 < min(inside["valleys"]) <= max(inside["valleys"]) < 0.98, inside  # 95 %, with an error of 1 %
