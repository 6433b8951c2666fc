"""The noise of angles that positions show, against dense Gaussian algebra, and the choice whether to use it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from oracles import bones
from scipy.spatial.transform import Rotation
from small_worlds import root_of, simulated

from adapt.diagnosis.fit.discrepancy import TYPICAL, Discrepancy
from adapt.diagnosis.fit.likeliest import likeliest
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.diagnosis.fit.positions.position_rows import PositionRows
from adapt.diagnosis.fit.posterior import modes
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.search import Search, search_of
from models import load_model
from models.adapted_parameters import ADAPTED, PERSON_SD_MM
from models.effects import EFFECTS
from motions import Motions

MODEL = load_model("R2")
MOVES, SHAPE = "sc_translation", "thorax_asymmetry"
NOISE_MM, NOISE_DEG, N = 1.0, 1.5, len(ADAPTED)

NOTHING_COMMON = TYPICAL._replace(
    noise_deg=1.2,
    common_motion_deg=0.0,
    common_deg=0.0,
    common_mm=0.0,
    common_turn_deg=0.0,
    own_mm=0.0,
    own_turn_deg=0.0,
)
"""Hyperparameters without common curves, which would lose a share of their variance, so that the algebra is exact."""

AT_THE_TOP = 0.2
"""Largest further step of an amplitude, in posterior SDs."""


def places(motions: Motions) -> dict[str, np.ndarray]:
    """Compute positions (postures, 3) of R2 at the angles of the motions, with noise."""
    R_C, R_S = (Rotation.from_euler("YZX", one, degrees=True).as_matrix() for one in np.split(motions.angles_deg, 2, 1))
    base, shake = bones(MODEL.girdle), np.random.default_rng(5)
    AC = base.sc_mm + R_C @ base.ac_mm
    found = {
        "SC": np.tile(base.sc_mm, (len(AC), 1)),
        "AC": AC,
        "TS": AC + R_S @ base.ts_mm,
        "AI": AC + R_S @ base.ai_mm,
    }
    return {name: place + NOISE_MM * shake.standard_normal(place.shape) for name, place in found.items()}


@cache
def laid_out(of_the_same_marker: bool = False) -> Search:
    """Lay out the search of subjects whose landmarks are at the angles without noise, or at the measured angles.

    With ``of_the_same_marker``, a marker carries the landmarks, and the angles are measured by it.
    """
    true = simulated(noise_deg=0.0).motions
    noise = NOISE_DEG * np.random.default_rng(7).standard_normal(true.angles_deg.shape)
    measured = replace(true, angles_deg=true.angles_deg + noise)
    landmarks = places(measured if of_the_same_marker else true)
    shoulders, _ = usable(replace(measured, landmarks_mm=landmarks))
    return search_of(MODEL, shoulders, [EFFECTS[MOVES], EFFECTS[SHAPE]], position_noise_mm=NOISE_MM)


def rows_of(search: Search) -> PositionRows:
    """Return the position rows of a search."""
    assert search.joint.positions is not None
    return search.joint.positions


def with_shared_noise(search: Search, found: Discrepancy):
    """Return the joint fit with angle noise in y, without shared constants; its rows, B and likelihood."""
    rows = rows_of(search)
    B = search.without_causes.B * np.deg2rad(1.0)
    rows = replace(rows, noise_in_y=B, by_common=rows.by_common[..., :0])
    joint = replace(search.joint, positions=rows)
    return joint, rows, B, Likelihood.of(joint, found)


def test_angles_and_positions_have_the_density_of_both_with_the_noise_that_they_share():
    search, found = laid_out(), NOTHING_COMMON
    joint, rows, B, likelihood = with_shared_noise(search, found)
    shoulders, candidates, generator = joint.shoulders, joint.candidates, np.random.default_rng(4)
    where, count = candidates.where((MOVES,)), len(shoulders.subject)
    mean, scale = candidates.mean[where], candidates.scale[where]
    theta = joint.model.theta_mm + PERSON_SD_MM * generator.standard_normal(joint.model.theta_mm.shape)
    y, Z = generator.standard_normal((count, 3)), generator.standard_normal((count, 3, N + len(candidates.scale)))
    every, here = np.arange(len(candidates.scale)), np.zeros(len(candidates.scale))
    here[where] = generator.standard_normal(len(where))
    evidence = likelihood.evidence(theta, y, Z, every, here).given(where, here[where], mean, scale)

    same, n = shoulders.subject[:, None] == shoulders.subject, rows.values_mm.shape[1]
    elevation, along = shoulders.coordinates_deg

    def near(one: np.ndarray) -> np.ndarray:
        apart = np.sqrt(3.0) * np.abs(one[:, None] - one) / found.length_deg
        return (1.0 + apart) * np.exp(-apart)

    of_motion = near(along) * (shoulders.motion[:, None] == shoulders.motion)
    smooth = same * near(elevation) * (found.of_motion_deg**2 * of_motion + found.of_shoulder_deg**2)
    of_all = np.zeros((count, 3 + n, count, 3 + n))
    of_all[:, :3, :, :3] = np.einsum("rs,cd->rcsd", smooth, np.eye(3))
    lever = found.noise_deg * np.concatenate([B, rows.by_angle], axis=1)
    at = np.arange(count)
    of_all[at, :, at] += lever @ np.swapaxes(lever, 1, 2)
    of_all[at, 3:, at, 3:] += rows.noise_mm**2 * rows.of_noise
    of_all[:, 3:, :, 3:] += found.people**2 * np.einsum("rs,rni,smi->rnsm", same, rows.by_constant, rows.by_constant)
    slopes = np.concatenate([Z[..., N + where], rows.by_amplitude[..., where]], axis=1)
    of_theta = np.einsum("rs,rck,sdk->rcsd", same + 1.0, Z[..., :N] * PERSON_SD_MM, Z[..., :N] * PERSON_SD_MM)
    of_all[:, :3, :, :3] += of_theta
    alike = found.between_shoulders**2 * same + 1.0
    of_all += np.einsum("rs,rnk,smk->rnsm", alike, slopes * scale, slopes * scale)
    apart = (joint.model.theta_mm - theta)[shoulders.subject]
    of_y = y + np.einsum("rck,rk->rc", Z[..., :N], apart) + Z[..., N + where] @ (mean - here[where])
    middle = np.concatenate([of_y, rows.values_mm + rows.by_amplitude[..., where] @ mean], axis=1).ravel()
    total = of_all.reshape(len(middle), -1)
    density = -0.5 * (np.linalg.slogdet(total).logabsdet + middle @ np.linalg.solve(total, middle))
    assert evidence.log_evidence == pytest.approx(density, rel=1e-8)
    moved = slopes.reshape(len(middle), -1).T @ np.linalg.solve(total, middle)
    np.testing.assert_allclose(evidence.amplitude, mean - scale**2 * moved, rtol=1e-6, atol=1e-8)


def test_at_the_mode_the_linear_model_stays_where_it_is():
    search = laid_out()
    joint, _, _, likelihood = with_shared_noise(search, TYPICAL._replace(between_shoulders=1e-3))
    start = search.without_causes.theta_mm
    where = joint.candidates.where((MOVES,))
    (found,) = modes(joint, likelihood, [(MOVES,)], [start], [np.zeros(len(where))])
    mean, scale = joint.candidates.mean[where], joint.candidates.scale[where]
    given = found.evidence.given(where, found.amplitude, mean, scale)
    assert np.linalg.norm(root_of(given).T @ (given.amplitude - found.amplitude)) < AT_THE_TOP


def test_a_fit_to_some_of_the_rows_knows_what_these_show():
    search = laid_out()
    joint, rows, _, _ = with_shared_noise(search, NOTHING_COMMON)
    seen = joint.shoulders.motion == 0
    some = Likelihood.of(joint, NOTHING_COMMON, seen).shown
    assert some is not None
    np.testing.assert_array_equal(some.added[~seen], 0.0)
    hidden = replace(joint, positions=replace(rows, measured=rows.measured & seen[:, None]))
    alone = Likelihood.of(hidden, NOTHING_COMMON).shown
    assert alone is not None
    np.testing.assert_allclose(some.added[seen], alone.added[seen], atol=1e-9)


@pytest.mark.parametrize("of_the_same_marker", [False, True])
def test_that_they_share_noise_is_believed_where_it_explains_more(of_the_same_marker):
    search = laid_out(of_the_same_marker)
    first = search.fit((), None)
    search._share_noise(first, likeliest(search.joint, first.posterior).discrepancy)
    assert (rows_of(search).noise_in_y is None) == of_the_same_marker
