"""Measured positions as data of the search: rows worked by hand, dense Gaussian algebra, and shown movements."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from oracles import bones
from scipy.spatial.transform import Rotation

from adapt.diagnosis.fit.candidates import Candidates, build_design
from adapt.diagnosis.fit.discrepancy import TYPICAL, Discrepancy, common_position_curves, own_position_curves
from adapt.diagnosis.fit.positions.position_evidence import position_evidence, shown_sizes
from adapt.diagnosis.fit.positions.position_rows import PositionRows, Seen, planned_rows
from adapt.diagnosis.fit.shoulders import Shoulders, usable
from adapt.diagnosis.inference.search import Search, search_of
from adapt.diagnosis.inference.selection import by_positions
from adapt.engine.batching import take_problems
from adapt.evaluation.person_constants import prior_of
from models import load_model
from models.effects import EFFECTS
from models.effects.basis import FULL_ELEVATION_DEG
from models.person.positions.measured_movement import AA_SD_MM
from motions import Motions
from motions.rhythm_subjects import simulate_subjects

MODEL = load_model("R2")
NAMES = ("scapula_landmark_bias", "ac_offset", "clavicle_length", "sc_translation", "ac_translation")
NOISE_MM = 1.0
SUBJECTS = 3

EXACT_MM = 1e-6
"""Tolerance for slopes of linear functions by differences of 1e-3: rounding."""

Places = dict[str, np.ndarray]
Moved = Callable[[Motions, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Function of the motions and the elevation relative to its maximum that returns the displacement of SC in the thorax
and of AC in the clavicle, (postures, 3) each."""


def nothing(motions: Motions, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Leave both joints at rest."""
    return np.zeros((len(f), 3)), np.zeros((len(f), 3))


def both(motions: Motions, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move SC and AC in proportion to the elevation."""
    return np.outer(f, SC_MM), np.outer(f, AC_MM)


def far(motions: Motions, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move SC and AC three times as far as ``both``."""
    return np.outer(f, 3.0 * SC_MM), np.outer(f, 3.0 * AC_MM)


SC_MM, AC_MM = np.array([3.0, -2.0, 4.0]), np.array([-2.0, 5.0, 3.0])


def places_by_hand(motions: Motions, moved: Moved, offset: np.ndarray | None = None) -> Places:
    """Compute positions (postures, 3) of R2 at the angles of the motions; ``offset`` moves AC in the clavicle."""
    R_C, R_S = (Rotation.from_euler("YZX", one, degrees=True).as_matrix() for one in np.split(motions.angles_deg, 2, 1))
    base = bones(MODEL.girdle)
    of_sc, of_ac = moved(motions, motions.humerus_elevation_deg / FULL_ELEVATION_DEG)
    SC = base.sc_mm + of_sc
    AC = SC + np.einsum("rij,rj->ri", R_C, base.ac_mm + of_ac + (0.0 if offset is None else offset))
    return {"SC": SC, "AC": AC, "TS": AC + R_S @ base.ts_mm, "AI": AC + R_S @ base.ai_mm}


@cache
def laid_out(moved: Moved = nothing, noise_mm: float = 0.0, without: str = "") -> Search:
    """Lay out the search of subjects with these positions; ``without`` is an unmeasured landmark."""
    motions = simulate_subjects(SUBJECTS, seed=3)
    shake = np.random.default_rng(5)
    places = {
        name: place + noise_mm * shake.standard_normal(place.shape)
        for name, place in places_by_hand(motions, moved).items()
        if name != without
    }
    shoulders, _ = usable(replace(motions, landmarks_mm=places))
    return search_of(MODEL, shoulders, [EFFECTS[name] for name in NAMES], position_noise_mm=NOISE_MM)


def parts(search: Search) -> tuple[PositionRows, Candidates, Shoulders]:
    """Return the position rows of a search, with its candidates and shoulders."""
    rows = search.joint.positions
    assert rows is not None
    return rows, search.joint.candidates, search.joint.shoulders


def amplitudes(candidates: Candidates, **sizes: np.ndarray) -> np.ndarray:
    """Return all amplitudes: ``sizes`` in the first term of each direction of these effects, 0 elsewhere."""
    a = np.zeros(len(candidates.scale))
    for name, size in sizes.items():
        a[candidates.places[name][:: len(candidates.effect(name).basis.sd)]] = size
    return a


def test_the_rows_are_what_a_hand_computes():
    rows, candidates, _ = parts(laid_out(both))
    left = rows.values_mm + rows.by_amplitude @ amplitudes(candidates, sc_translation=SC_MM, ac_translation=AC_MM)
    np.testing.assert_allclose(left, 0.0, atol=EXACT_MM)
    np.testing.assert_array_equal(rows.of_noise[0], np.kron(SEEN, np.eye(3)))


def test_a_constant_of_the_person_is_in_the_constants():
    """Check the row of TS 5 mm lateral on the scapula: 5 / S of the third constants; all other rows are 0."""
    rows, _, shoulders = parts(laid_out())
    root = np.linalg.cholesky(prior_of(MODEL, shoulders.subjects)[..., 0])
    own = np.zeros(len(root))
    own[6] = 5.0  # the constants are SC, AC, then TS: its x
    R_S = Rotation.from_euler("YZX", shoulders.motions.angles_deg[:, 3:], degrees=True).as_matrix()
    found = rows.by_constant[shoulders.subject == 0] @ np.linalg.solve(root, own)
    np.testing.assert_allclose(found[:, 6:9], 5.0 * R_S[shoulders.subject == 0, :, 0], atol=EXACT_MM)
    np.testing.assert_allclose(found[:, [0, 1, 2, 3, 4, 5, 9, 10, 11]], 0.0, atol=EXACT_MM)


def test_what_all_persons_have_in_common_of_a_constant_is_a_cause():
    """Check that a constant which all persons share belongs to the candidates, except for AA, which no candidate moves.

    Without candidates the shared constants are as large as the individual ones.
    """
    _, _, shoulders = parts(laid_out())
    girdle = laid_out().joint.model.sets.girdle
    listed, none = (
        build_design([EFFECTS[name] for name in names], shoulders) for names in (EFFECTS, ["conoid_strain"])
    )
    landmarks = ("SC", "AC", "AA")
    rows, alone = (planned_rows(MODEL, girdle, one, shoulders, landmarks) for one in (listed, none))
    np.testing.assert_allclose(rows.by_common[:, :6], 0.0, atol=EXACT_MM)
    of_all, of_each, of_listed = (
        np.einsum("rni,rmi->rnm", one, one) for one in (alone.by_common, alone.by_constant, rows.by_common)
    )
    np.testing.assert_allclose(of_all, of_each, atol=1e-8)
    np.testing.assert_allclose(of_listed[:, 6:, 6:], AA_SD_MM**2 * np.tile(np.eye(3), (len(of_all), 1, 1)), atol=1e-8)


def test_what_carries_a_landmark_and_was_not_measured_is_passed_over():
    rows, candidates, _ = parts(laid_out(both, without="AC"))
    left = rows.values_mm + rows.by_amplitude @ amplitudes(candidates, sc_translation=SC_MM, ac_translation=AC_MM)
    np.testing.assert_allclose(left, 0.0, atol=EXACT_MM)
    assert left.shape[1] == 9


def test_the_lever_of_an_angle_is_the_length_of_the_bone():
    """Check AC seen from SC: protraction and elevation move it by the length of the bone, axial rotation not."""
    rows, _, _ = parts(laid_out())
    of_length = np.deg2rad(1.0) * np.linalg.norm(bones(MODEL.girdle).ac_mm)
    across = np.sqrt((rows.by_angle[:, 3:6] ** 2).sum(axis=(1, 2)))
    assert np.all(across <= np.sqrt(2.0) * of_length * 1.001)
    assert np.all(across >= of_length)
    np.testing.assert_allclose(rows.by_angle[:, :3], 0.0, atol=EXACT_MM)


def test_the_noise_of_angles_turns_the_scapula_as_one_bone():
    """Check that TS and AI, seen from AC, turn together: the distance between them stays."""
    rows, _, shoulders = parts(laid_out())
    R_S = Rotation.from_euler("YZX", shoulders.motions.angles_deg[:, 3:], degrees=True).as_matrix()
    base = bones(MODEL.girdle)
    apart = R_S @ (base.ai_mm - base.ts_mm)
    np.testing.assert_allclose(
        np.einsum("rm,rmi->ri", apart, rows.by_angle[:, 9:12] - rows.by_angle[:, 6:9]), 0.0, atol=EXACT_MM
    )


SEEN = np.array([[1, -1, 0, 0], [-1, 2, -1, -1], [0, -1, 2, 1], [0, -1, 1, 2]], float)
"""Covariance of SC, AC - SC, TS - AC and AI - AC where each place has a variance of 1."""

NOT_SMOOTH = TYPICAL._replace(own_mm=0.0, common_mm=0.0, own_turn_deg=0.0, common_turn_deg=0.0)


def dense(
    rows: PositionRows,
    shoulders: Shoulders,
    candidates: Candidates,
    where: np.ndarray,
    found: Discrepancy,
    mean_is_known: bool = False,
):
    """Compute the covariance of all measured coordinates without smooth parts, with (rows, n) flattened."""
    same = shoulders.subject[:, None] == shoulders.subject
    n, count = rows.values_mm.shape[1], len(rows.values_mm)
    L = rows.by_angle.reshape(count * n, -1)
    total = rows.noise_mm**2 * np.kron(np.eye(count), np.kron(SEEN[: n // 3, : n // 3], np.eye(3)))
    total += found.noise_deg**2 * np.kron(np.eye(count), np.ones((n, n))) * (L @ L.T)
    H, C, A = (x.reshape(count * n, -1) for x in (rows.by_constant, rows.by_common, rows.by_amplitude[..., where]))
    total += found.people**2 * np.kron(same, np.ones((n, n))) * (H @ H.T) + C @ C.T
    between = np.kron(found.between_shoulders**2 * same + (0.0 if mean_is_known else 1.0), np.ones((n, n)))
    return total + between * (A @ np.diag(candidates.scale[where] ** 2) @ A.T)


def test_the_evidence_is_the_density_of_the_positions_with_all_else_integrated_out():
    """Check without smooth parts, because a few curves do not hold all of their variance."""
    rows, candidates, shoulders = parts(laid_out(both, noise_mm=1.0))
    found, where = NOT_SMOOTH, candidates.where(("sc_translation", "ac_translation"))
    mean, scale = candidates.mean[where], candidates.scale[where]
    given = (
        position_evidence(rows, shoulders, found)
        .only(where)
        .given(np.arange(len(where)), np.zeros(len(where)), mean, scale)
    )
    total = dense(rows, shoulders, candidates, where, found)
    middle = (rows.values_mm + rows.by_amplitude[..., where] @ mean).ravel()
    density = -0.5 * (np.linalg.slogdet(total).logabsdet + middle @ np.linalg.solve(total, middle))
    assert given.log_evidence == pytest.approx(density, rel=1e-7)
    A = rows.by_amplitude[..., where].reshape(middle.size, -1)
    expected = mean - scale**2 * (A.T @ np.linalg.solve(total, middle))
    np.testing.assert_allclose(given.amplitude, expected, rtol=1e-5, atol=1e-7)


def near_of(one: np.ndarray, length: float) -> np.ndarray:
    """Compute the Matern 3/2 kernel."""
    d = np.sqrt(3.0) * np.abs(one[:, None] - one) / length
    return (1.0 + d) * np.exp(-d)


@pytest.mark.parametrize("length", [30.0, 60.0])
def test_curves_hold_most_of_what_is_smooth(length):
    """Check that curves lose less than a tenth of the variance of a smooth course, and add none."""
    _, _, shoulders = parts(laid_out())
    (elevation, along), first = shoulders.coordinates_deg, shoulders.rows_of(0)
    near, near_along = near_of(elevation, length), near_of(along, length)
    own = (near * (1.0 + near_along * (shoulders.motion[:, None] == shoulders.motion)))[np.ix_(first, first)] / 2.0
    found = own_position_curves(shoulders, first, length), common_position_curves(shoulders, length)
    for curves, covariance in zip(found, (own, near), strict=True):
        lost = covariance - curves @ curves.T
        assert np.trace(lost) < 0.1 * len(lost)
        assert np.linalg.eigvalsh(lost)[0] > -0.1


def test_curves_are_of_their_sizes_in_every_coordinate_and_every_angle():
    """Check the sizes of curves against the covariance of a shoulder: curves of positions, and of angles through
    levers."""
    rows, candidates, shoulders = parts(laid_out())
    none, one = np.zeros(0, int), shoulders.rows_of(0)
    rows = replace(rows, by_amplitude=rows.by_amplitude[..., none], by_common=rows.by_common[..., none])
    smooth = NOT_SMOOTH._replace(own_mm=2.0, own_turn_deg=3.0, common_mm=1.5, common_turn_deg=0.7)
    total, n = dense(rows, shoulders, candidates, none, smooth), rows.values_mm.shape[1]
    (at,) = np.nonzero(np.repeat(shoulders.subject == 0, n))
    total, L = total[np.ix_(at, at)], rows.by_angle[one].reshape(len(at), -1)
    curves = own_position_curves(shoulders, one, 40.0), common_position_curves(shoulders, 40.0)[one]
    for curve, of_places, of_turns in zip(curves, (2.0, 1.5), (3.0, 0.7), strict=True):
        total += of_places**2 * np.kron(curve @ curve.T, np.eye(n))
        total += of_turns**2 * np.kron(curve @ curve.T, np.ones((n, n))) * (L @ L.T)
    values = rows.values_mm[one].ravel()
    density = -0.5 * (np.linalg.slogdet(total).logabsdet + values @ np.linalg.solve(total, values))
    evidence = position_evidence(rows, shoulders, smooth).of(np.array([0]))
    given = evidence.given(none, np.zeros(0), np.zeros(0), np.zeros(0))
    assert given.log_evidence == pytest.approx(density, rel=1e-9)


def test_landmarks_that_a_cluster_carries_do_not_show_what_turns_the_frame():
    rows, candidates, _ = parts(laid_out())
    where = candidates.where(("scapula_landmark_bias",))
    others = np.setdiff1d(np.arange(len(candidates.scale)), where)
    carried = rows.carried(candidates)
    assert np.abs(rows.by_amplitude[:, 6:, where]).max() > 1.0
    np.testing.assert_array_equal(carried.by_amplitude[..., where], 0.0)
    np.testing.assert_array_equal(carried.by_amplitude[..., others], rows.by_amplitude[..., others])


def test_beside_angles_of_them_no_landmark_is_left_that_a_cluster_may_carry():
    rows, candidates, shoulders = parts(laid_out())
    some = rows.beside_angles_of_them(shoulders.angles)
    assert some is not None
    assert some.values_mm.shape[1] == 4, "SC, and AC along the clavicle"
    np.testing.assert_array_equal(some.carried(candidates).by_amplitude, some.by_amplitude)


def test_what_was_not_measured_is_no_row():
    rows, candidates, shoulders = parts(laid_out(both, noise_mm=1.0))
    hidden = rows.measured.copy()
    hidden[shoulders.subject == 1, 3:6] = False
    where, found = candidates.where(("ac_translation",)), NOT_SMOOTH
    some = replace(rows, measured=hidden)
    given = position_evidence(some, shoulders, found).only(where)
    value = given.given(np.arange(len(where)), np.zeros(len(where)), candidates.mean[where], candidates.scale[where])
    total = dense(rows, shoulders, candidates, where, found)
    kept = hidden.ravel()
    middle = (rows.values_mm + rows.by_amplitude[..., where] @ candidates.mean[where]).ravel()[kept]
    total = total[np.ix_(kept, kept)]
    density = -0.5 * (np.linalg.slogdet(total).logabsdet + middle @ np.linalg.solve(total, middle))
    assert value.log_evidence == pytest.approx(density, rel=1e-7)


def test_positions_show_a_joint_that_moves_and_no_other():
    """Check movements of 16 and 18 mm with the arm up, of three persons with a degree of noise in their angles."""
    moves, rests = (laid_out(one, noise_mm=0.5) for one in (far, nothing))
    for name in ("sc_translation", "ac_translation"):
        assert by_positions(moves, name, ("sc_translation", "ac_translation")) > 0.9
        assert by_positions(rests, name, (name,)) < 0.2
    shown = shown_sizes(
        moves.likelihood.positions, moves.joint.candidates, ("sc_translation", "ac_translation"), {"sc_translation"}
    )
    assert shown is not None
    assert shown.names == ("sc_translation",)
    first = shown.given.amplitude[:: len(EFFECTS["sc_translation"].basis.sd)]
    np.testing.assert_allclose(first, 3.0 * SC_MM, atol=3.0)


def test_of_angles_that_are_of_the_same_landmarks_the_path_of_sc_and_the_length_of_the_clavicle_are_left():
    search = laid_out(both)
    rows, candidates, shoulders = parts(search)
    left = rows.beside_angles_of_them(shoulders.angles)
    assert left is not None
    f = shoulders.motions.humerus_elevation_deg / FULL_ELEVATION_DEG
    np.testing.assert_allclose(left.values_mm[:, :3], -np.outer(f, SC_MM), atol=EXACT_MM)
    np.testing.assert_allclose(left.values_mm[:, 3], -f * AC_MM[0], atol=EXACT_MM)  # x of the clavicle is its axis
    across = candidates.where(("ac_translation",))[3:]  # three terms each of along, up, back
    np.testing.assert_allclose(left.by_amplitude[:, 3, across], 0.0, atol=EXACT_MM)
    np.testing.assert_allclose(np.diagonal(left.of_noise, axis1=1, axis2=2), [[1.0, 1.0, 1.0, 2.0]] * len(f))
    on_skin = rows.beside_angles_of_them(shoulders.angles, ac_is_on_the_bone=False)
    assert on_skin is not None
    np.testing.assert_array_equal(on_skin.values_mm, left.values_mm[:, :3])
    only_scapula = parts(laid_out(both, without="SC"))[0]
    assert only_scapula.beside_angles_of_them(shoulders.angles) is None


@pytest.mark.parametrize(
    "effect", [one for one in EFFECTS.values() if not one.moves_landmarks], ids=lambda one: one.name
)
def test_what_is_said_to_move_no_landmark_moves_none(effect):
    """Check that effects without ``moves_landmarks`` move none, to the rounding of a rotation and its inverse.

    The statement of an effect's first course covers its second course.
    """
    search = laid_out()
    seen = Seen(("SC", "AC", "TS", "AI"), take_problems(search.joint.model.sets.girdle, search.joint.shoulders.subject))
    moved = seen.by_channel([replace(effect, moves_landmarks=True)], search.joint.shoulders.angles)
    np.testing.assert_allclose(moved, 0.0, atol=EXACT_MM)


def test_what_landmarks_would_tell_of_amplitudes_is_known_before_they_are_measured():
    """Check the precision of a in a linear Gaussian model, A' C^-1 A, which does not depend on the measured values."""
    _, candidates, shoulders = parts(laid_out())
    model = laid_out().joint.model
    rows = planned_rows(MODEL, model.sets.girdle, candidates, shoulders, ("SC", "AC"))
    where, found = candidates.where(("ac_translation",)), NOT_SMOOTH
    evidence = position_evidence(rows, shoulders, found).only(where)
    precision = evidence.of_amplitudes(candidates.mean[where], candidates.scale[where])[:-1, :-1]
    total = dense(rows, shoulders, candidates, where, found, mean_is_known=True)
    A = rows.by_amplitude[..., where].reshape(len(total), -1)
    np.testing.assert_allclose(precision, A.T @ np.linalg.solve(total, A), rtol=1e-6, atol=1e-9)
