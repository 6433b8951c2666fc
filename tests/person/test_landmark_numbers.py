# pyright: reportOptionalMemberAccess=false, reportAttributeAccessIssue=false, reportArgumentType=false
# pyright: reportGeneralTypeIssues=false
# (own_bones is None after a plain adaptation; pandas types nearly every result as "Series | object")
"""Own bones that landmarks measure: by hand, and for simulated persons with known bones."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from oracles import bones, cardan
from own_girdles import OWN, with_sizes

from adapt import adapt_subjects
from adapt.own_bones.own_adaptation import People
from adapt.own_bones.scales import Scales
from adapt.solvers.posture_fits import fit_batch
from models import load_model
from models.girdle import Girdle
from models.person.own_bones import NAMES, spread_about
from models.person.positions.landmark_numbers import IN_GIRDLE, KEYS, numbers_of
from motions import Motions
from motions.landmarks.sampled_postures import measured_places_mm
from motions.rhythm_subjects import add_noise, noise_free_subjects
from motions.rotations import DEG

R2 = load_model("R2")
NOISE_DEG, LANDMARK_MM = 1.5, 3.0
SHOWN = ("SC_x", "SC_y", "SC_z", "clavicle_length", "scapula_size", "TS_x", "AI_x", "AI_y")
KNOWN = People({}, {"R2": Scales(noise_deg=NOISE_DEG)}, {"R2": {}})


def only(**sds: float) -> People:
    return replace(KNOWN, sds=dict.fromkeys(NAMES, 0.0) | sds)


@pytest.fixture(scope="module")
def persons() -> tuple[np.ndarray, Motions]:
    """Twenty persons with SC, AC, TS and AI at 3 mm, independent of angle frames and joints."""
    generator = np.random.default_rng(11)
    wanted, sd = noise_free_subjects(30, generator), spread_about(R2).sd
    sizes = sd[:, None] * generator.standard_normal((len(OWN), 30))
    each = [with_sizes(bones(R2.girdle), dict(zip(OWN, own, strict=True))) for own in sizes.T]
    girdle = Girdle(**{key: np.stack([getattr(b, key) for b in each], axis=-1) for key in vars(each[0])})
    person = wanted.subject_number
    chain = Girdle.of_numbers(np.asarray(girdle.numbers_mm)[:, person])
    fitted = fit_batch(chain, wanted.angles_deg.T / DEG, np.ones((6, len(person)), bool))
    closes = np.bincount(person, fitted.status != "ok") == 0
    landmarks = {name: np.empty((len(person), 3)) for name in ("SC", "AC", "TS", "AI")}
    for row, (k, angles_deg) in enumerate(zip(person.tolist(), fitted.angles.T * DEG, strict=True)):
        own = with_sizes(bones(R2.girdle), {name: sizes[OWN.index(name), k] for name in SHOWN})
        clavicle, scapula = cardan(angles_deg[:3])[0], cardan(angles_deg[3:])[0]
        landmarks["SC"][row] = own.sc_mm
        landmarks["AC"][row] = own.sc_mm + clavicle @ own.ac_mm
        landmarks["TS"][row], landmarks["AI"][row] = (
            landmarks["AC"][row] + scapula @ point for point in (own.ts_mm, own.ai_mm)
        )
    noisy = {name: x + LANDMARK_MM * generator.standard_normal(x.shape) for name, x in landmarks.items()}
    motions = add_noise(replace(wanted, angles_deg=fitted.angles.T * DEG), NOISE_DEG, generator)
    motions = replace(motions, landmarks_mm=noisy)
    there = np.flatnonzero(closes)[:20]
    return sizes[:, there], motions.select(np.isin(person, there))


def without_landmarks(motions: Motions) -> Motions:
    return replace(motions, landmarks_mm={})


def test_one_number_is_the_mean_of_the_set_and_the_landmarks_by_their_precisions(persons):
    """Check SC_z with a prior SD of 2 mm, a median of known SD, and angles that tell nothing."""
    _, motions = persons
    one = motions.select(motions.subject == motions.subjects[0])
    own = adapt_subjects(
        one, R2, held_out=(), own_bones=replace(only(SC_z=2.0), everybody={"R2": Scales(noise_deg=1e6)})
    ).problems.own_bones
    k, z = OWN.index("SC_z"), one.landmarks_mm["SC"][:, 2]
    sd = max(1.2533 * z.std(ddof=1) / np.sqrt(len(z)), 0.96)
    precision = 1.0 / 2.0**2 + 1.0 / sd**2
    assert own.sizes[k, 0] == pytest.approx((np.median(z) - R2.girdle.sc_mm[2]) / sd**2 / precision, rel=1e-4)
    assert own.sd[k, 0] == pytest.approx(precision**-0.5, rel=1e-4)


def test_landmarks_narrow_the_intervals_and_cover_the_truth(persons):
    sizes, motions = persons
    found, angles_alone = (adapt_subjects(one, R2, own_bones=KNOWN) for one in (motions, without_landmarks(motions)))
    own, others = found.problems.own_bones, angles_alone.problems.own_bones
    for name, most in (("SC_x", 0.3), ("SC_y", 0.3), ("SC_z", 0.3), ("clavicle_length", 0.3), ("AI_y", 0.7)):
        k = OWN.index(name)
        assert (own.sd[k] < most * others.sd[k]).all(), name
    shown = [OWN.index(name) for name in SHOWN]
    within = np.abs(own.sizes - sizes) <= 1.96 * own.sd
    assert 0.90 <= within[shown].mean() <= 1.0
    assert 0.90 <= within.mean() <= 0.99
    for bone in ("clavicle", "scapula"):
        column = f"{bone}_gap_unseen_deg"
        assert found.heldout[column].mean() <= 1.01 * angles_alone.heldout[column].mean()


def test_a_motion_held_out_holds_its_landmarks_out_too(persons):
    _, motions = persons
    one = motions.select(motions.subject == motions.subjects[0])
    kinds = list(dict.fromkeys(one.motion.tolist()))
    moved = {name: place.copy() for name, place in one.landmarks_mm.items()}
    moved["SC"][one.motion == kinds[0]] += 20.0
    before, after = (
        adapt_subjects(some, R2, own_bones=KNOWN).heldout for some in (one, replace(one, landmarks_mm=moved))
    )
    held = before["held_out"] == kinds[0]
    pd.testing.assert_frame_equal(
        *(table[held].drop(columns=[c for c in table if "in_sample" in c]) for table in (before, after))
    )
    assert (before["gap_unseen_deg"] != after["gap_unseen_deg"])[~held].all()


def test_what_the_set_has_measured_is_not_measured_twice(persons):
    """Check SC measured for the person's set, to 1.5 mm: the landmarks, which may be the same, add nothing."""
    _, motions = persons
    one = motions.select(motions.subject == motions.subjects[0])
    measured = replace(R2, source=R2.source | {"clavicle.sc_mm": "measured: of P01; +-1.5 mm"})
    own, alone = (
        adapt_subjects(some, measured, held_out=(), own_bones=KNOWN).problems.own_bones
        for some in (one, replace(one, landmarks_mm={"TS": one.landmarks_mm["TS"], "AC": one.landmarks_mm["AC"]}))
    )
    k = OWN.index("SC_x")
    assert own.prior_sd[k, 0] == 1.5
    assert own.sd[k, 0] == pytest.approx(alone.sd[k, 0], rel=0.02)


def test_the_numbers_of_the_set_are_found_in_its_own_landmarks():
    girdle = bones(R2.girdle)
    clavicle, scapula = cardan([-25.0, 12.0, 5.0])[0], cardan([30.0, 10.0, -10.0])[0]
    AC = girdle.sc_mm + clavicle @ girdle.ac_mm
    where = {"SC": girdle.sc_mm, "AC": AC, "TS": AC + scapula @ girdle.ts_mm, "AI": AC + scapula @ girdle.ai_mm}
    found = numbers_of({name: place[:, None] for name, place in where.items()}, np.ones(1, bool))
    np.testing.assert_allclose(found.values_mm, np.asarray(R2.girdle.numbers_mm)[list(IN_GIRDLE)], atol=1e-9)
    np.testing.assert_array_equal(found.sd_mm, 3.0)
    assert len(KEYS) == len(IN_GIRDLE) == 7


def test_an_sc_that_was_placed_is_not_measured(persons):
    _, motions = persons
    placed = replace(motions, extra=motions.extra.assign(clavicle_from="SC from IJ"))
    places = measured_places_mm(placed)
    assert {name for name, place in places.items() if np.isfinite(place).any()} == {"AC", "TS", "AI"}
