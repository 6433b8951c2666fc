"""The differentiable adaptation: its optimum against ``adapt_subjects``, its derivatives against finite differences of
``adapt_subjects``, and ``vmap`` over padded subjects against each subject alone."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from adapted_alone import POSTURES, alone, padded, theta_and_result
from programs import few_runs

from adapt import adapt_subjects
from adapt.differentiable import WEIGHT, adapt_subject, fit_posture
from adapt.engine.batching import take_problems
from models import load_model, model_names
from models.adapted_parameters import ADAPTED_PARAMETERS
from motions import InputError, read_motions
from motions.rhythm_subjects import DATA_FILE
from motions.table import Motions

SAME_E = 1e-9
"""Relative tolerance."""

SAME_THETA_MM = 1e-6
"""Tolerance for the optimum of the compiled solver, which ends at a stationarity of 1e-9."""

ALONE = 1e-12
"""Tolerance relative to the largest number, between a batch and a subject alone."""

BOTH_WAYS = 1e-9
"""Relative to the largest number: forward and reverse mode solve the same 6 x 6 and 9 x 9 systems."""

BY_DIFFERENCES = 1e-5
"""Tolerance relative to the largest component, for four-point differences with error h^4. With these steps theta moves
by some 0.05 mm and is known to 1e-10 mm, also in the flat direction of M_y and A_y; where theta moves by 2 mm, the
differences are off by 3 %."""

STEP_RAD, STEP_MM, STEP_W = 2e-5, 2e-3, 0.01

SETS = model_names()
SHIPPED = read_motions(DATA_FILE)
OF_ALL_SETS = "simulated02"
"""Subject with A_y at its bound in three sets, and with all parameters free in three."""

COUNTS = (5, 10, 18, POSTURES)
"""Numbers of postures of further subjects; with the six above there are ten, with 5 to 22 postures."""

SHORT = 2
"""Number of measured angles in a posture that they do not determine."""


def angles_of(subject: str) -> np.ndarray:
    return np.deg2rad(SHIPPED.angles_deg[SHIPPED.subject == subject].T)


def unequal_subjects() -> list[np.ndarray]:
    """Make subjects with these numbers of postures; beyond the 14 shipped ones, postures repeat with noise."""
    noise, found = np.random.default_rng(0), []
    for subject, count in zip(SHIPPED.subjects, COUNTS, strict=False):
        own = angles_of(subject)
        again = own + np.deg2rad(noise.normal(0.0, 1.5, own.shape))
        found.append(np.concatenate([own, again], axis=1)[:, :count])
    return found


UNEQUAL = unequal_subjects()


def lanes() -> list[tuple]:
    """Return one problem per set, the unequal subjects with R2, and one with an undetermined posture."""
    undetermined = angles_of(OF_ALL_SETS)
    undetermined[SHORT:, 0] = np.nan
    chosen = [(name, angles_of(OF_ALL_SETS)) for name in SETS]
    chosen += [("R2", one) for one in [*UNEQUAL, undetermined]]
    models = [load_model(name) for name, _ in chosen]
    angles = [padded(angles) for _, angles in chosen]
    return [
        (one.girdle, one.points_mm, one.bounds_mm, s, WEIGHT, np.isfinite(s))
        for one, s in zip(models, angles, strict=True)
    ]


LANES = lanes()
UNEQUAL_LANES = range(len(SETS), len(SETS) + len(COUNTS))


@pytest.fixture(scope="module")
def side_by_side():
    """Compute derivatives of theta in all inputs, and the result, of all problems: jit of vmap in reverse mode."""
    together = jax.tree.map(lambda *x: jnp.stack([jnp.asarray(one) for one in x]), *LANES)
    slopes, found = few_runs(jax.vmap(jax.jacrev(theta_and_result, argnums=(0, 1, 2, 3, 4), has_aux=True)))(*together)
    return jax.tree.map(np.asarray, (slopes, found))


def lane(tree, number: int):
    return jax.tree.map(lambda x: x[number], tree)


def motions_of(subjects: dict[str, np.ndarray]) -> Motions:
    """Make subjects with angles (6, postures) in rad, one motion each."""
    count = [angles.shape[1] for angles in subjects.values()]
    return Motions(
        subject=np.repeat(list(subjects), count),
        motion=np.full(sum(count), "abduction"),
        posture=np.concatenate([np.arange(1, n + 1) for n in count]),
        humerus_elevation_deg=np.concatenate([np.linspace(0.0, 120.0, n) for n in count]),
        angles_deg=np.rad2deg(np.concatenate(list(subjects.values()), axis=1).T),
        landmarks_mm={},
        extra=SHIPPED.extra.iloc[:0].reindex(range(sum(count))).fillna("simulated"),
    )


def test_the_optimum_is_that_of_adapt_subjects(side_by_side):
    _, found = side_by_side
    one = adapt_subjects(motions_of({"one": angles_of(OF_ALL_SETS)}), [load_model(name) for name in SETS], held_out=())
    unequal = adapt_subjects(motions_of({f"S{k}": x for k, x in enumerate(UNEQUAL)}), load_model("R2"), held_out=())
    expected = [take_problems(one.adapted[name], [0]) for name in SETS]
    expected += [take_problems(unequal.adapted["R2"], [k]) for k in range(len(UNEQUAL))]
    for number, reference in enumerate(expected):
        ours = lane(found, number)
        assert ours.converged
        np.testing.assert_allclose(ours.E, reference.E[0], rtol=SAME_E)
        np.testing.assert_allclose(ours.theta_mm, reference.theta_mm[:, 0], rtol=0.0, atol=SAME_THETA_MM)
        np.testing.assert_array_equal(ours.free, ~reference.at_bound[:, 0])
        np.testing.assert_allclose(ours.D_mm2, reference.D_mm2[0], rtol=SAME_E)


def test_free_and_held_parameters_are_tried(side_by_side):
    free = side_by_side[1].free[: len(SETS)]
    assert 0 < np.sum(~free.all(axis=1)) < len(SETS)


def test_padding_has_no_slope(side_by_side):
    slopes, found = side_by_side
    for number, count in zip(UNEQUAL_LANES, COUNTS, strict=True):
        of_angles = slopes[3][number]
        assert np.isfinite(of_angles).all()
        assert not of_angles[:, :, count:].any()
        assert of_angles[:, :, :count].any(axis=(0, 1)).all()
        assert not found.postures.j_deg2[number][count:].any()


def test_an_undetermined_posture_makes_its_subject_nan_alone(side_by_side):
    slopes, found = side_by_side
    assert not found.converged[-1]
    assert np.isnan(found.theta_mm[-1]).all()
    assert np.isnan(slopes[4][-1]).all()
    assert found.converged[:-1].all()


def test_ten_side_by_side_are_one_by_one_and_reverse_is_forward(side_by_side):
    slopes, found = side_by_side
    for number in range(UNEQUAL_LANES.stop):
        one, slope = alone(*LANES[number])
        for ours, theirs in zip(jax.tree.leaves(one), jax.tree.leaves(lane(found, number)), strict=True):
            np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=ALONE * np.abs(theirs).max(initial=1.0))
        in_reverse = sum(np.reshape(x[number], (6, -1)).sum(axis=1) for x in jax.tree.leaves(slopes))
        assert_close(slope.theta_mm, in_reverse, BOTH_WAYS)


def assert_close(found, expected, tolerance: float) -> None:
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=tolerance * np.abs(expected).max())


AT = (1, -1, 2, -2)


def difference(thetas, step: float) -> np.ndarray:
    """Compute the derivative from theta at ``AT`` times a step."""
    up, down, twice_up, twice_down = thetas
    return (8.0 * (up - down) - (twice_up - twice_down)) / (12.0 * step)


def test_slopes_in_the_angles(side_by_side):
    slopes, _ = side_by_side
    own, random = angles_of(OF_ALL_SETS), np.random.default_rng(1)
    directions = random.normal(size=(3, *own.shape))
    moved = {f"{d}{at}": own + at * STEP_RAD * x for d, x in enumerate(directions) for at in AT}
    result = adapt_subjects(motions_of(moved), [load_model(name) for name in SETS], held_out=()).adapted
    for number, name in enumerate(SETS):
        thetas = result[name].theta_mm.T.reshape(3, len(AT), 6)
        for d, direction in enumerate(directions):
            ours = np.einsum("kap,ap->k", slopes[3][number][:, :, : own.shape[1]], direction)
            assert_close(ours, difference(thetas[d], STEP_RAD), BY_DIFFERENCES)


def test_slopes_in_w(side_by_side):
    slopes, _ = side_by_side
    motions, models = motions_of({"one": angles_of(OF_ALL_SETS)}), [load_model(name) for name in SETS]
    thetas = [adapt_subjects(motions, models, WEIGHT + at * STEP_W, held_out=()).adapted for at in AT]
    for number, name in enumerate(SETS):
        expected = difference([one[name].theta_mm[:, 0] for one in thetas], STEP_W)
        assert_close(slopes[4][number], expected, BY_DIFFERENCES)


ADAPTED_FIELDS = {(one.field, one.component) for one in ADAPTED_PARAMETERS}


def girdle_directions(girdle) -> dict[str, np.ndarray]:
    """Draw a random direction in every field, with 0 in the adapted parameters, which are only a start."""
    random, found = np.random.default_rng(2), {}
    for name, value in vars(girdle).items():
        direction = random.normal(size=np.shape(value))
        for k in range(np.size(value)):
            if (name, k) in ADAPTED_FIELDS:
                direction.reshape(-1)[k] = 0.0
        if direction.any():
            found[name] = direction
    return found


def moved_sets(name: str) -> dict[str, tuple]:
    """Return for each direction the sets at ``AT``, and a projection of derivatives of theta on it."""
    model = load_model(name)
    found = {}
    for field, direction in girdle_directions(model.girdle).items():
        sets = [
            replace(
                model, girdle=replace(model.girdle, **{field: getattr(model.girdle, field) + at * STEP_MM * direction})
            )
            for at in AT
        ]
        found[field] = sets, lambda slopes, f=field, d=direction: np.reshape(getattr(slopes[0], f), (6, -1)) @ d.ravel()
    random = np.random.default_rng(3)
    of_points, of_bounds = (random.normal(size=x.shape) for x in (model.points_mm, model.bounds_mm))
    sets = [replace(model, points_mm=model.points_mm + at * STEP_MM * of_points) for at in AT]
    found["points"] = sets, lambda slopes: np.einsum("kip,ip->k", slopes[1], of_points)
    sets = [replace(model, bounds_mm=model.bounds_mm + at * STEP_MM * of_bounds) for at in AT]
    found["bounds"] = sets, lambda slopes: np.einsum("kib,ib->k", slopes[2], of_bounds)
    return found


def test_slopes_in_every_number_of_the_girdle_in_the_points_and_in_the_bounds(side_by_side):
    slopes, found = side_by_side
    cases = {(number, what): case for number, name in enumerate(SETS) for what, case in moved_sets(name).items()}
    models = [
        replace(one, name=f"{number} {what} {at}")
        for (number, what), (sets, _) in cases.items()
        for at, one in zip(AT, sets, strict=True)
    ]
    result = adapt_subjects(motions_of({"one": angles_of(OF_ALL_SETS)}), models, held_out=()).adapted
    for (number, what), (_, along) in cases.items():
        expected = difference([result[f"{number} {what} {at}"].theta_mm[:, 0] for at in AT], STEP_MM)
        ours = along(lane(slopes, number))
        if what == "bounds" and found.free[number].all():
            assert not ours.any()
        else:
            assert_close(ours, expected, BY_DIFFERENCES)
        if what != "bounds":
            assert not ours[~found.free[number]].any()


def test_what_is_only_a_start_has_no_slope(side_by_side):
    slopes, _ = side_by_side
    for field, component in ADAPTED_FIELDS:
        of_field = np.reshape(getattr(slopes[0], field)[: len(SETS)], (len(SETS), 6, -1))
        assert not of_field[:, :, component].any()


def test_degrees_are_refused_where_they_can_be_seen():
    model, angles = load_model("R2"), np.rad2deg(angles_of("simulated01"))
    with pytest.raises(InputError, match="Give radians"):
        fit_posture(model.girdle, angles)
    with pytest.raises(InputError, match="Give radians"):
        adapt_subject(model.girdle, model.points_mm, model.bounds_mm, angles)
