"""The joint fit against `girdle adapt` and finite differences, and its quadratic steps against SciPy."""

from dataclasses import replace
from functools import partial
from itertools import count

import jax
import numpy as np
import pytest
from programs import few_runs
from scipy.optimize import minimize
from small_worlds import joint_fit, simulated

from adapt import adapt_subjects
from adapt.diagnosis.fit.candidates import Hypothesis
from adapt.diagnosis.fit.joint_fit import THORAX_DOWNWEIGHTING, JointFit, _minimum
from adapt.diagnosis.inference.search import search_of
from adapt.engine.batching import take_problems
from adapt.solvers.projection import damped_steps, gauss_newton
from adapt.solvers.projection.bounded_step import lowest
from adapt.solvers.projection.gauss_newton import End
from adapt.solvers.projection.grouped_problems import GroupedProblems
from adapt.solvers.projection.nearest_posture import THERE, _nearest_kernel, nearest_postures
from adapt.solvers.projection.subjects import weight_of_sizes
from models import load_model
from models.effects import EFFECTS, ActiveEffects, AnyGirdle
from models.effects.amplitudes import PersonalSize
from motions.rotations import DEG

R2 = partial(adapt_subjects, models=load_model("R2"), held_out=(), thorax_downweighting=THORAX_DOWNWEIGHTING)
"""Adaptation of R2, whose thorax points are another person's and down-weighted."""

SAME_E = 1e-4
"""Gain in mm^2 below which the joint fit stops."""

SAME_SIZE = 1e-2
"""Tolerance for sizes in SDs, for a search that stops at a gain of ``SAME_E``."""

SAME_DEG = 1e-7
"""Both solvers close the chain to 1e-9 mm and end at steps below 1e-9 deg."""

STEP, SAME_SLOPES = 1e-3, 1e-6
"""Step (mm, or a unit of strength) and relative tolerance of central differences: postures are known to 1e-11 deg."""

FD = 1e-5
"""Step of differences in units of the amplitude's scale: E's rounding, 1e-10, gives 1e-5, the truncation less."""


def test_without_effects_it_is_the_adaptation_of_girdle_adapt():
    joint = joint_fit()
    adapted = R2(simulated().motions).adapted["R2"]
    np.testing.assert_allclose(joint.from_starts().E, adapted.E, atol=SAME_E)


def each_alone(joint: JointFit) -> JointFit:
    """Make every problem a group of its own."""
    return joint.of(tuple(problem._replace(group=k) for k, problem in enumerate(joint.problems)))


def adapted(joint: JointFit, hypothesis: Hypothesis, theta_mm, amplitude, between: float) -> End:
    """Adapt every problem with its own sizes about an amplitude; ``between``: their SD, in prior SDs."""
    shared = joint._shared([hypothesis] * joint.groups)
    mean = np.tile(np.reshape(amplitude, (-1, 1)), joint.groups)
    scale = between * shared.scale / np.sqrt(weight_of_sizes(joint._grouped))
    return _minimum(with_slopes(joint), shared._replace(scale=scale, mean=mean), theta_mm, mean)


def with_slopes(joint: JointFit) -> GroupedProblems:
    """Return the problems with slopes in the strengths too, at fixed postures, as E needs them."""
    return replace(joint._grouped, strengths_are_known=False)


def test_personal_sizes_give_the_optimum_of_girdle_adapt():
    name, between = "scapula_landmark_bias", 0.7
    joint = joint_fit(name)
    mean, scale = (3.0, -4.0, 5.0), joint.candidates.scale[joint.candidates.where((name,))]
    effects = {name: PersonalSize(mean, tuple(between * scale))}
    exact = R2(simulated(name).motions, effects=effects).adapted["R2"]
    start = joint.from_starts()
    found = adapted(each_alone(joint), (name,), start.theta_mm.T, mean, between)
    assert (exact.status == "ok").all()
    of_sizes = joint.model.weight / (6.0 * np.array([len(problem.rows) for problem in joint.problems]))
    sizes = ((found.amplitude.T - mean) / (between * scale)).T
    ours, theirs = found.E + of_sizes * (sizes**2).sum(axis=0), exact.E + of_sizes * (exact.sizes**2).sum(axis=0)
    np.testing.assert_allclose(ours, theirs, atol=SAME_E)
    np.testing.assert_allclose(sizes, exact.sizes, atol=SAME_SIZE)
    assert (start.E > exact.E + 1.0).all()


@pytest.mark.parametrize("strength", [0.0, 0.99])
def test_the_nearest_posture_is_that_of_slsqp(strength):
    """Check the nearest posture against SciPy's SLSQP with JAX's derivatives of the constraints, started there."""
    joint = joint_fit()
    rows = np.arange(0, len(joint.shoulders.subject), 9)
    girdle = take_problems(joint.model.sets.girdle, joint.shoulders.subject[rows])
    generator = np.random.default_rng(3)
    scale = np.concatenate([one.prior.scale for one in joint.model.effects])
    strengths = strength * scale[:, None] * generator.standard_normal((joint.candidates.columns.shape[1], len(rows)))
    angles = joint.shoulders.angles[:, rows]
    near = nearest_postures(girdle, joint.model.effects, strengths, angles, np.ones(angles.shape, bool))
    counts = [one.basis.channels(len(one.directions)) for one in joint.model.effects]
    active = ActiveEffects(tuple(np.split(strengths, np.cumsum(counts)[:-1])), joint.model.effects)
    for k in range(len(rows)):
        found = slsqp(take_problems(active.on(girdle), k), angles[:, k] * DEG, near.angles[:, k] * DEG)
        np.testing.assert_allclose(near.angles[:, k] * DEG, found.x, atol=SAME_DEG)
        np.testing.assert_allclose((near.y[:, k] ** 2).sum(), found.fun, rtol=1e-9)


def slsqp(chain: AnyGirdle, target_deg: np.ndarray, start_deg: np.ndarray):
    """Minimise |q - s|^2 on the closed chain, in degrees."""
    found = minimize(
        lambda q: np.sum((q - target_deg) ** 2),
        start_deg,
        jac=lambda q: 2.0 * (q - target_deg),
        constraints={"type": "eq", "fun": lambda q: _open_mm(q, chain), "jac": lambda q: _slopes(q, chain)},
        method="SLSQP",
        options={"ftol": 1e-12},
    )
    assert found.success
    return found


_open_mm = few_runs(lambda q_deg, chain: chain.residuals_mm(q_deg / DEG))
_slopes = few_runs(jax.jacobian(lambda q_deg, chain: chain.residuals_mm(q_deg / DEG)))


def test_the_whole_slopes_of_y_are_differences():
    """Check slopes in which the nearest posture moves; slopes at fixed postures are off by some percent."""
    joint = joint_fit("scapulothoracic_gap")
    problems, theta = with_slopes(joint), joint.from_starts().theta_mm
    strengths = 2.0 * np.random.default_rng(5).standard_normal(problems.strengths.shape)
    near = problems.nearest(theta, strengths)
    whole = problems.with_whole_slopes(theta, strengths, near)

    def differences(in_theta, in_strengths):
        up, down = (
            problems.nearest(theta + k * in_theta, strengths + k * in_strengths, near.angles).y for k in (STEP, -STEP)
        )
        return (up - down) / (2.0 * STEP)

    for k in range(len(theta)):
        seen = differences(np.eye(len(theta))[k][:, None], 0.0)
        assert relative(whole.by_theta[:, k], seen) < SAME_SLOPES
        assert relative(near.by_theta[:, k], seen) > 100.0 * SAME_SLOPES
    for k in range(len(strengths)):
        seen = differences(0.0, np.eye(len(strengths))[k][:, None])
        assert relative(whole.by_channel[:, k], seen) < SAME_SLOPES


def test_a_posture_at_a_gimbal_lock_has_no_slopes_and_leaves_the_others_theirs():
    """Check one posture at gimbal lock, from a diagnosis: its slopes are 0, and those of other postures stay.

    A gap that follows the angles of a frame has no derivative in the frame's rotation where the middle angle is 90
    degrees.
    """
    effects = [EFFECTS[name] for name in ("scapula_landmark_bias", "scapulothoracic_gap:posture")]
    joint = search_of(load_model("R2"), joint_fit().shoulders, effects).joint
    problems, theta = joint._grouped, joint.from_starts().theta_mm
    strengths = np.zeros(problems.strengths.shape)
    strengths[3:] = np.reshape([-3.8, -1.5, 3.6, 5.9, -0.8, -2.8], (-1, 1))
    near = problems.nearest(theta, strengths)
    whole = problems.with_whole_slopes(theta, strengths, near)
    locked = near.angles.copy()
    locked[:, 3] = np.array([-82.10, 27.15, 24.98, 17.65, 90.001, 30.96]) / DEG
    found = problems.with_whole_slopes(theta, strengths, near._replace(angles=locked))
    assert not found.by_theta[..., 3].any()
    assert not found.by_channel[..., 3].any()
    assert whole.by_theta[..., 3].any()
    for one, other in ((found.by_theta, whole.by_theta), (found.by_channel, whole.by_channel)):
        np.testing.assert_array_equal(np.delete(one, 3, axis=-1), np.delete(other, 3, axis=-1))


def relative(found, expected) -> float:
    """Return the mean absolute difference, relative to the mean absolute value."""
    return np.abs(found - expected).mean() / max(np.abs(expected).mean(), 1e-9)


def test_its_slope_in_the_amplitudes_is_that_of_finite_differences():
    joint = joint_fit("scapulothoracic_gap")
    name = "scapulothoracic_gap"
    where = joint.candidates.where((name,))
    theta, a = joint.from_starts().theta_mm, 0.3 * joint.candidates.scale[where]
    problems, columns = with_slopes(joint), joint.candidates.columns[where][..., joint.rows]

    def squares(amplitude):
        strengths = np.einsum("k,kcr->cr", amplitude, columns)
        return problems.nearest(theta, strengths)

    near = squares(a)
    by_amplitude = np.einsum("icr,kcr->ikr", near.by_channel, columns)
    slope = 2.0 * np.einsum("r,ikr,ir->k", problems.weights, by_amplitude, near.y)
    for k, scale in enumerate(joint.candidates.scale[where]):
        step = np.zeros(len(a))
        step[k] = FD * scale
        up, down = (float((problems.weights * (squares(a + s).y ** 2).sum(axis=0)).sum()) for s in (step, -step))
        assert slope[k] * scale == pytest.approx((up - down) / (2.0 * FD), rel=1e-4, abs=1e-4)


def test_the_quadratic_step_is_the_lowest_within_its_bounds():
    generator = np.random.default_rng(11)
    problems, k = 3, 2
    root = generator.standard_normal((problems, 12, 6 + k))
    matrix = np.einsum("pij,pik->jkp", root, root)
    gradient = 5.0 * generator.standard_normal((problems, 6 + k)).T
    room = np.full((6, problems), -0.3), np.full((6, problems), 0.2)
    prior = np.eye(k)[..., None] * 0.7
    prior_gradient = generator.standard_normal((k, 1))
    dtheta, da = lowest(gradient, matrix, np.zeros(problems, int), prior_gradient, prior, room)

    def value(x):
        theta, a = x[: 6 * problems].reshape(6, problems), x[6 * problems :]
        d = np.concatenate([theta, np.tile(a[:, None], problems)])
        own = 0.5 * np.einsum("ip,ijp,jp->", d, matrix, d) + (gradient * d).sum()
        return own + 0.5 * a @ prior[..., 0] @ a + prior_gradient[:, 0] @ a

    bounds = [(-0.3, 0.2)] * (6 * problems) + [(None, None)] * k
    best = minimize(
        value, np.zeros(6 * problems + k), method="L-BFGS-B", bounds=bounds, options={"maxiter": 5000, "ftol": 1e-15}
    )
    found = np.concatenate([dtheta.ravel(), da.ravel()])
    assert value(found) == pytest.approx(best.fun, rel=1e-6)
    assert ((dtheta == -0.3) | (dtheta == 0.2)).any(), "no bound was met: the case tests nothing"


def test_machine_code_and_xla_agree():
    joint = joint_fit()
    rows = np.arange(8)
    girdle = jax.tree.map(np.ascontiguousarray, take_problems(joint.model.sets.girdle, np.zeros(8, int)))
    channels = joint.candidates.columns.shape[1]
    angles = joint.shoulders.angles[:, rows]
    none, sd, there = np.zeros((channels, 8)), np.full(angles.shape, 1.0 / DEG), np.full(8, THERE)
    arguments = girdle, girdle.adapted_mm, none, angles, sd, angles, there
    kernel = _nearest_kernel(joint.model.effects, False)
    native = kernel.native(*arguments)
    for one, other in zip(native, kernel.by_jax(*arguments), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-9)
    *others, _ = native
    for one, other in zip(_nearest_kernel(joint.model.effects, True).native(*arguments), others, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)  # the kernel with known strengths


@pytest.mark.parametrize("few", [0.0, 0.99])
def test_groups_that_go_on_without_the_others_end_where_they_do_beside_them(few, monkeypatch):
    """Check that groups end in the same place, up to rounding, whether or not finished groups stay in the batch."""
    joint = joint_fit("scapula_landmark_bias")
    name, start, mean = ("scapula_landmark_bias",), joint.from_starts().theta_mm.T, np.zeros(3)
    problems = each_alone(joint)
    monkeypatch.setattr(damped_steps, "_FEW", few)
    every = adapted(problems, name, start, mean, 1.0)
    assert every.settled.all()
    for group, problem in enumerate(problems.problems):
        alone = adapted(joint.of((problem._replace(group=0),)), name, start[[group]], mean, 1.0)
        assert alone.settled.all()
        np.testing.assert_allclose(alone.E, every.E[[group]], rtol=1e-9)
        np.testing.assert_allclose(alone.amplitude[:, 0], every.amplitude[:, group], rtol=1e-6)


def test_a_group_at_a_wall_ends_without_having_settled(monkeypatch):
    """Check an objective that is higher at every trial point."""
    joint, higher, evaluate = joint_fit("scapula_landmark_bias"), count(), gauss_newton.Objective.total

    def total(*given):
        return evaluate(*given) + 1e6 * next(higher)

    monkeypatch.setattr(gauss_newton.Objective, "total", total)
    start, problems = joint.model.theta_mm, each_alone(joint)
    walled = adapted(problems, (), start, np.zeros(0), 1.0)
    assert not walled.settled.any()
    np.testing.assert_array_equal(walled.theta_mm.T, start)
    assert next(higher) < 2 * 20, "with the mean sizes, and with each one's own"
