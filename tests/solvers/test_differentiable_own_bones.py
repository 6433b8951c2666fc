# pyright: reportOptionalMemberAccess=false
# (own_bones is None after a plain adaptation)
"""Own bones as a differentiable function: the minimum against the compiled search, derivatives against differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from programs import few_runs

from adapt import adapt_subjects
from adapt.differentiable import AdaptedSubject, OwnPrior, adapt_subject
from adapt.differentiable.adapted_subject import ENDLESS
from adapt.differentiable.closest_posture import Postures, target
from adapt.differentiable.constrained_optimum import SOFTLY, softly
from adapt.engine.batching import take_problems
from adapt.own_bones.own_adaptation import People
from adapt.own_bones.scales import Scales
from models import load_model
from models.adapted_parameters import ADAPTED
from models.person.own_bones import SIZES
from motions import read_motions
from motions.rhythm_subjects import DATA_FILE

SAME_E = 1e-9
"""Relative tolerance."""

SAME_SDS = 1e-5
"""Tolerance for a size: the compiled search ends where the slope is a millionth of the prior's pull."""

BY_DIFFERENCES = 1e-6
"""Tolerance relative to the largest component, for four-point differences: sizes converge to 1e-9 SDs."""

NEAR_SDS = 0.1
"""Largest difference of any size between a chain with a slack of 0.01 mm and one without (seen: 0.01)."""

STEPS = {"angles": 2e-5, "girdle": 2e-3, "columns": 1e-4, "noise": 1e-4, "weight": 0.1}
"""Steps in rad, mm, relative, deg."""

SCALES = Scales(adapted=0.9, bones=1.1, frames=0.8, noise_deg=1.5)
FACTORS = {"adapted": 0.9, "bones": 1.1, "frames": 0.8}
MODEL = load_model("R2")
PRIOR = OwnPrior.about(MODEL, SCALES.noise_deg, FACTORS)
MOTIONS = read_motions(DATA_FILE)
SUBJECTS = ("simulated02", "simulated03")
"""Subjects of which the first one's search ends elsewhere without the compiled search's result as start."""

POSTURES = 16
"""Number of postures; the last two are padding."""

AT = (1, -1, 2, -2)


def angles_of(subject: str) -> np.ndarray:
    angles = np.deg2rad(MOTIONS.angles_deg[MOTIONS.subject == subject].T)
    return np.pad(angles, ((0, 0), (0, POSTURES - angles.shape[1])), constant_values=np.nan)


@pytest.fixture(scope="module")
def compiled():
    people = People({}, {MODEL.name: SCALES}, {MODEL.name: {}})
    motions = MOTIONS.select(np.isin(MOTIONS.subject, SUBJECTS))
    return adapt_subjects(motions, MODEL, held_out=(), own_bones=people).of(MODEL.name)


def start_of(compiled, subject: str) -> np.ndarray:
    own = take_problems(compiled.own_bones, SUBJECTS.index(subject))
    return own.sizes / own.prior_sd


def result(numbers: dict, known, start) -> AdaptedSubject:
    return adapt_subject(
        numbers["girdle"],
        *(MODEL.points_mm, MODEL.bounds_mm, numbers["angles"], known, numbers["weight"]),
        own_bones=OwnPrior(numbers["columns"], numbers["noise"]),
        start=start,
    )


def numbers_of(subject: str) -> dict:
    """Return the inputs, all float64: a Python number has a weak type, and would need another program."""
    columns, noise = PRIOR
    numbers = {"girdle": MODEL.girdle, "angles": angles_of(subject), "columns": columns, "noise": noise, "weight": 10.0}
    return jax.tree.map(lambda x: jnp.asarray(x, float), numbers)


@few_runs
def with_slopes(numbers: dict, moved: dict, known, start):
    """Compute the result, and its derivative in the direction ``moved``."""
    return jax.jvp(lambda numbers: result(numbers, known, start), (numbers,), (moved,))


def solved(subject: str, start, numbers: dict | None = None, moved: dict | None = None):
    numbers = numbers_of(subject) if numbers is None else numbers
    moved = jax.tree.map(jnp.zeros_like, numbers) if moved is None else moved
    return with_slopes(numbers, moved, np.isfinite(angles_of(subject)), start)


@pytest.mark.parametrize("subject", SUBJECTS)
def test_the_minimum_is_that_of_the_compiled_search(compiled, subject):
    found, _ = solved(subject, start_of(compiled, subject))
    expected = take_problems(compiled.adapted, SUBJECTS.index(subject))
    assert found.converged
    np.testing.assert_allclose(found.E, expected.E, rtol=SAME_E)
    np.testing.assert_allclose(found.sizes, start_of(compiled, subject), atol=SAME_SDS)
    np.testing.assert_allclose(found.theta_mm, expected.theta_mm, atol=SAME_SDS * max(one.sd for one in SIZES))
    np.testing.assert_allclose(found.theta_mm, found.girdle.adapted_mm)
    assert found.free.all()
    assert len(found.theta_mm) == len(ADAPTED)


def test_chains_with_slack_lead_near_it(compiled):
    angles = angles_of("simulated03")
    s, R = target(MODEL.girdle, angles, np.isfinite(angles))

    measured, sizes = jnp.sum(R != 0.0, axis=0), PRIOR.columns_mm.shape[1]
    root = jnp.sqrt(10.0 / jnp.sum(measured))

    @few_runs
    def with_slack(girdle, prior):
        of_prior = prior.columns_mm, ENDLESS * jnp.ones(sizes), MODEL.points_mm[:, :0], root * prior.noise_deg
        problem = Postures(s, R, root * jnp.sqrt(measured), girdle, *of_prior)
        return softly(problem, (jnp.zeros(sizes), s), SOFTLY)[0]

    expected = start_of(compiled, "simulated03")
    away = np.abs(with_slack(jax.tree.map(jnp.asarray, MODEL.girdle), PRIOR) - expected).max()
    assert away < NEAR_SDS < np.abs(expected).max()  # the set has sizes 0


def direction(what: str, numbers: dict) -> dict:
    """Draw a random direction in one input: relative for the columns, and only for measured angles."""
    random = np.random.default_rng(5)
    moved = jax.tree.map(jnp.zeros_like, numbers)
    sizes = {"columns": numbers["columns"]}
    moved[what] = jax.tree.map(
        lambda x: jnp.where(jnp.isfinite(x), random.normal(size=x.shape), 0.0), sizes.get(what, numbers[what])
    )
    if what == "columns":
        moved[what] = moved[what] * numbers[what]
    return moved


@pytest.mark.parametrize("what", STEPS)
def test_slopes_are_differences(compiled, what):
    subject = SUBJECTS[1]
    start, numbers = start_of(compiled, subject), numbers_of(subject)
    moved = direction(what, numbers)
    _, slope = solved(subject, start, numbers, moved)
    ends = []
    for at in AT:
        there = jax.tree.map(lambda x, d, at=at: x + at * STEPS[what] * d, numbers, moved)
        found, _ = solved(subject, start, there)
        ends.append(np.concatenate([found.sizes, found.girdle.numbers_mm]))
    up, down, twice_up, twice_down = ends
    expected = (8.0 * (up - down) - (twice_up - twice_down)) / (12.0 * STEPS[what])
    ours = np.concatenate([slope.sizes, slope.girdle.numbers_mm])
    if what == "weight":
        np.testing.assert_allclose(ours, 0.0, atol=1e-7)  # the optimum does not depend on w
    np.testing.assert_allclose(ours, expected, rtol=0.0, atol=BY_DIFFERENCES * max(1.0, np.abs(expected).max()))
