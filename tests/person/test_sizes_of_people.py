"""Variation of persons about a set: SDs, the change of a girdle per size, the columns of parameters.csv."""

from dataclasses import replace

import jax
import numpy as np
import pytest
from oracles import bones
from own_girdles import OWN, numbers, with_sizes

from adapt.own_bones.own_adaptation import OwnBones
from adapt.tables.results import FAR_SDS, UNTOLD, own_columns
from models import load_model, model_names
from models.adapted_parameters import ADAPTED, PERSON_SD_MM
from models.effects import EFFECTS
from models.girdle import NUMBERS
from models.person.own_bones import NAMES, SIZES, of_chain, spread_about, with_own_sizes

R2 = load_model("R2")
SIX = len(ADAPTED)


def sd_of(name: str, model=R2, **sds: float) -> float:
    return float(spread_about(model, sds).sd[NAMES.index(name)])


def sourced(**sources: str):
    """Return R2 with other sources."""
    return replace(R2, source=R2.source | {key.replace("__", "."): text for key, text in sources.items()})


@pytest.mark.parametrize("model", model_names())
def test_a_column_is_what_one_sd_of_a_size_does_to_a_girdle(model):
    one = load_model(model)
    spread, plain = spread_about(one), bones(one.girdle)
    for k, (name, sd) in enumerate(zip(OWN, spread.sd.tolist(), strict=True)):
        moved = numbers(with_sizes(plain, {name: sd})) - numbers(plain)
        np.testing.assert_allclose(spread.columns_mm[:, k], moved, atol=1e-12, err_msg=name)


def test_girdles_with_sizes_of_their_own():
    """Check a batch against each of its girdles alone."""
    generator = np.random.default_rng(1)
    sizes = generator.standard_normal((len(OWN), 4))
    repeated = R2.girdle.repeated(4)
    found = with_own_sizes(repeated, {size.key: values for size, values in zip(SIZES, sizes, strict=True)})
    for k in range(4):
        expected = with_sizes(bones(R2.girdle), dict(zip(OWN, sizes[:, k], strict=True)))
        np.testing.assert_allclose(numbers(bones(found, k)), numbers(expected), rtol=1e-13)


def test_the_chain_sees_the_thorax_from_sc():
    moved = of_chain(np.asarray(R2.girdle.numbers_mm))
    np.testing.assert_array_equal(moved[NUMBERS["sc_mm"]], 0.0)
    np.testing.assert_allclose(moved[NUMBERS["centre_mm"]], R2.girdle.centre_mm - R2.girdle.sc_mm)
    np.testing.assert_array_equal(moved[NUMBERS["ts_mm"]], R2.girdle.ts_mm)


def test_the_six_differ_less_than_adapted_ones():
    """Check own bones against the scatter of ten adaptations (Table 6.5), in which ellipsoids also compensate for
    bones.

    The exception is the narrow A_x.
    """
    sd, others = spread_about(R2).sd[:SIX], np.arange(SIX) != ADAPTED.index("A_x")
    assert (sd[others] < PERSON_SD_MM[others]).all()


@pytest.mark.parametrize(
    ("name", "key", "source", "sd"),
    [
        ("TS_distance", "constraint.ts_distance_mm", "assumed: of another; +-6 mm", 5.0),  # root of 4^2 + (6 / 2)^2
        ("TS_distance", "constraint.ts_distance_mm", "Table 3.2", 4.0),
        ("TS_distance", "constraint.ts_distance_mm", "measured: landmarks of P01; +-1.5 mm", 1.5),
        ("TS_distance", "constraint.ts_distance_mm", "measured: landmarks of P01", 4.0),
        ("SC_y", "clavicle.sc_mm", "assumed: of another; +-24 mm", 13.0),  # root of 5^2 + (24 / 2)^2
        ("clavicle_length", "clavicle.length_mm", "measured: SC to AC; +-2 mm", 100.0 * 2.0 / 158.0),
        ("A_y", "thorax.semi_axes_mm", "measured: points of P01; +-5 mm", 5.0),
        ("A_y", "thorax.semi_axes_mm", "measured: points of P01; +-50 mm", 12.0),
        ("A_x", "thorax.semi_axes_mm", "measured: points of P01; +-5 mm", 4.0),
        ("scapula_frame_z", "scapula.ts_mm", "measured: of P01; +-1 mm", 4.0),
    ],
)
def test_an_sd_holds_the_spread_of_people_and_what_a_set_states(name, key, source, sd):
    assert sd_of(name, sourced(**{key: source})) == pytest.approx(sd)


def test_a_scapula_is_measured_when_both_its_points_are():
    half = sourced(scapula__ts_mm="measured: of P01; +-1 mm", scapula__ai_mm="Table 3.2")
    assert sd_of("scapula_size", half) == sd_of("scapula_size", sourced())
    whole = sourced(scapula__ts_mm="measured: of P01; +-1 mm", scapula__ai_mm="measured: of P01; +-1 mm")
    assert sd_of("scapula_size", whole) == 0.0
    assert sd_of("TS_x", whole) == 1.0


def test_an_sd_that_is_given_is_taken():
    assert sd_of("TS_x", TS_x=0.0) == 0.0
    assert sd_of("A_y", A_y=7.0) == 7.0
    assert sd_of("AI_x", TS_x=0.0) == sd_of("AI_x")


def test_every_size_has_a_source_and_a_column_of_its_own():
    assert len(set(NAMES)) == len(NAMES)
    assert all(size.sd > 0.0 and size.source for size in SIZES)
    directions = np.stack([size.per_unit(jax.tree.map(np.asarray, R2.girdle)) for size in SIZES], axis=-1)
    assert (np.abs(directions).max(axis=0) > 0.0).all()


def test_the_columns_say_who_is_far_and_what_is_not_told():
    n, far, told = len(SIZES), NAMES.index("TS_x"), NAMES.index("scapula_size")
    sizes, prior = np.zeros((n, 3)), np.ones((n, 3))
    sizes[far, 0], sizes[0, 0], sizes[far, 1] = -1.01 * FAR_SDS, 1.01 * FAR_SDS, 0.99 * FAR_SDS
    variance = np.full((n, 3), (1.01 * UNTOLD) ** 2)
    variance[told] = (0.99 * UNTOLD) ** 2
    covariance = np.einsum("ij,ip->ijp", np.eye(n), variance)
    scales = np.array([[1.2] * 3, [1.1] * 3, [0.9] * 3, [0.7] * 3])
    own = OwnBones(sizes, covariance, prior, scales, np.array([0, 1, 2]), 1.0 - variance)
    columns = own_columns(own, np.array(["ok", "ok", "not_converged"]))
    assert columns["far_from_people"].tolist() == ["M_y TS_x", "", ""]
    everything_else = " ".join(name for name in NAMES if name != "scapula_size")
    assert columns["not_told"].tolist() == [everything_else, everything_else, ""]
    np.testing.assert_array_equal(columns["TS_x_mm"], [sizes[far, 0], sizes[far, 1], np.nan])
    np.testing.assert_allclose(columns["scapula_size_percent_sd"], [0.99 * UNTOLD] * 2 + [np.nan])
    assert columns["noise_deg"].tolist() == [0.7] * 3
    assert columns["own_bones"].tolist() == ["adapted", "do_not_predict", ""]
    assert not any(name.startswith(ADAPTED) for name in columns)


def test_an_ac_elsewhere_is_what_the_effect_of_that_name_makes_of_it():
    """Check that sizes of a person and amplitudes of ``ac_offset`` move the same numbers by the same amounts."""
    effect, sizes = EFFECTS["ac_offset"], [one for one in SIZES if "_AC_" in one.name]
    assert [one.name for one in sizes] == [name.replace(" ", "_AC_") for name in effect.directions]
    none = np.zeros((3, 3)), np.zeros((3, 3))
    for size, mm in zip(sizes, np.eye(len(sizes)), strict=True):
        moved, _ = effect.adjust(R2.girdle, none, mm)
        np.testing.assert_allclose(moved.numbers_mm, R2.girdle.numbers_mm + size.per_unit(R2.girdle), rtol=1e-15)
