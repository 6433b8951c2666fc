"""The shipped parameter sets: the sources of their numbers, and the consistency of the numbers."""

import re
import tomllib
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from oracles import shortest_conoid_mm

from models import ParameterSet, load_model, model_names
from models.adapted_parameters import ADAPTED
from models.girdle import Girdle, constraint_residuals_mm, landmarks
from models.muscles.muscle_lines import published_lines
from models.parameter_sets import FOLDER
from motions.landmarks.frames import clavicle_frame, scapula_frame
from motions.rhythm import REST_DEG
from motions.rotations import DEG
from scripts.completion import (
    AC_JOINT_MM,
    POINT_AZIMUTHS_DEG,
    POINT_HEIGHTS_MM,
    Rule,
    completed_sets,
    das3_conoid_mm,
    own_rest_deg,
    table_sets,
    toml_text,
    write_sets,
)

CLOSED_MM = 1e-6
"""Tolerance: the numbers of the files have six decimals, and close the chain to one unit of the last."""

PRINTED_MM = 1e-9
"""Decimals of the thorax points, the finest numbers of the files."""

ON_THE_ELLIPSOID = 1e-9
"""Tolerance of sum (x_i / a_i)^2 - 1: half a unit of the points' last decimal, 5e-10 mm, times 2 / a, with room."""

_DISTANCES = ("ts_distance_mm", "ai_distance_mm")

COMPLETED = {completed.name: completed for completed in completed_sets()}
THESIS_SETS = ("R2", "R4", "R6")
CLOSED_AT_REST = (*THESIS_SETS, "breteler_dissection")
"""Sets closed at rest: in the MRI set the conoid is slack, and the numbers of DAS3 close to 2 mm."""

DAS3_SC, DSEM_SC, DSEM_AC, DSEM_AA = (
    np.array(published_lines()["das3"][f"{name}_mm"]) for name in ("joint_sc", "sc", "ac", "aa")
)

DAS3_ACROMION = np.array([207.7, -0.1, 28.2])
"""Point where DAS3 attaches its scapula, in its clavicle frame: not AC but AA, the origin of its scapula frame."""

DAS3_OPEN_MM = 2.0
"""Tolerance of A1-A3 with DAS3's numbers in the measured posture of its cadaver: two points of 1.4 mm (thesis 5.2)."""

ROUNDED_DEG = 0.005
"""Half the last digit of a rest posture that was found by search."""


def numbers_of(tree: dict[str, Any]) -> dict[str, Any]:
    """Return a dictionary from section.key to value, without name and source."""
    return {
        f"{section}.{key}": value
        for section, table in tree.items()
        if section not in ("name", "source")
        for key, value in table.items()
    }


def test_the_six_sets_are_shipped():
    assert model_names() == ("R2", "R4", "R6", "breteler_dissection", "breteler_mri", "das3")
    assert set(model_names()) == set(COMPLETED)


@pytest.mark.parametrize("name", model_names())
def test_a_shipped_set_loads(name):
    model = load_model(name)
    assert isinstance(model, ParameterSet)
    assert model.name == name
    assert model.points_mm.shape == (3, 24)
    assert model.bounds_mm.shape == (2, 6)
    lengths = {"ts_distance_mm", "ai_distance_mm", "conoid_length_mm"}
    for field, value in vars(model.girdle).items():
        assert value.shape == (() if field in lengths else (3,)), field
        assert value.dtype == jnp.float64, field


@pytest.mark.parametrize("name", model_names())
def test_every_number_of_a_shipped_set_has_its_source(name):
    model = load_model(name)
    tree = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    assert set(model.source) == set(numbers_of(tree))
    for key, text in model.source.items():
        assert re.match(r"(table|published|derived:|assumed:)", text, re.IGNORECASE), (key, text)


@pytest.mark.parametrize("name", model_names())
def test_the_file_is_what_the_derivation_makes(name):
    shipped = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
    derived = tomllib.loads(toml_text(COMPLETED[name]))
    assert shipped["source"] == derived["source"]
    assert shipped["name"] == derived["name"]
    assert numbers_of(shipped).keys() == numbers_of(derived).keys()
    for key, value in numbers_of(derived).items():
        np.testing.assert_allclose(numbers_of(shipped)[key], value, rtol=0.0, atol=PRINTED_MM, err_msg=key)


def test_the_script_writes_all_sets(tmp_path):
    write_sets(tmp_path)
    assert sorted(path.stem for path in tmp_path.iterdir()) == list(model_names())
    assert load_model(tmp_path / "R2.toml").name == "R2"


@pytest.mark.parametrize("name", CLOSED_AT_REST)
def test_the_chain_is_closed_at_rest(name):
    girdle = load_model(name).girdle
    residuals = constraint_residuals_mm(girdle, jnp.asarray(COMPLETED[name].rest_deg) / DEG)
    np.testing.assert_allclose(residuals, 0.0, rtol=0.0, atol=CLOSED_MM)


@pytest.mark.parametrize("name", CLOSED_AT_REST)
def test_the_stated_rest_posture_is_in_the_source(name):
    source = load_model(name).source
    clavicle, scapula = np.split(COMPLETED[name].rest_deg, 2)
    for key in ("scapula.conoid_mm", "constraint.ts_distance_mm", "constraint.ai_distance_mm"):
        stated = re.search(r"clavicle \((.*?)\), scapula \((.*?)\) deg", source[key])
        assert stated, key
        for text, angles in zip(stated.groups(), (clavicle, scapula), strict=True):
            np.testing.assert_array_equal([float(a) for a in text.split(",")], angles)


@pytest.mark.parametrize("name", model_names())
def test_thorax_points_are_on_the_ellipsoid_on_the_right(name):
    model = load_model(name)
    centre, axes = (np.asarray(v)[:, None] for v in (model.girdle.centre_mm, model.girdle.semi_axes_mm))
    on_sphere = (model.points_mm - centre) / axes
    np.testing.assert_allclose(np.sum(on_sphere**2, axis=0), 1.0, rtol=0.0, atol=ON_THE_ELLIPSOID)
    assert np.all(model.points_mm[0] > 0.0)
    azimuths = np.degrees(np.arctan2(on_sphere[2], on_sphere[0])).reshape(len(POINT_HEIGHTS_MM), -1)
    np.testing.assert_allclose(azimuths - POINT_AZIMUTHS_DEG, 0.0, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "printed_mm"),
    [
        (
            "breteler_dissection",
            {"AC": (165.0, 26.6, 71.4), "TS": (74.9, -11.2, 155.8), "AI": (102.5, -127.3, 155.7)},
        ),
        ("breteler_mri", {"AC": (145.7, 67.5, 58.2), "TS": (67.5, 33.6, 151.0), "AI": (98.7, -85.1, 152.5)}),
    ],
)
def test_the_cadaver_at_rest_has_the_printed_landmarks(name, printed_mm):
    """Table 4.2. Angles printed to 1e-6 deg move a point 300 mm away by 5e-6 mm."""
    at = landmarks(load_model(name).girdle, jnp.asarray(COMPLETED[name].rest_deg) / DEG)
    for landmark, position_mm in printed_mm.items():
        np.testing.assert_allclose(getattr(at, landmark), position_mm, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize(("name", "sides"), [("R2", (119, 113, 105)), ("R4", (100, 110, 109)), ("R6", (130, 109, 98))])
def test_the_scapula_has_the_printed_sides(name, sides):
    """Table 3.2: |AC-TS|, |AI-TS| and the angle AC-TS-AI."""
    ts, ai = (np.asarray(v) for v in (load_model(name).girdle.ts_mm, load_model(name).girdle.ai_mm))
    ac_ts, ai_ts = np.linalg.norm(ts), np.linalg.norm(ai - ts)
    angle_deg = np.degrees(np.arccos(-ts @ (ai - ts) / (ac_ts * ai_ts)))
    np.testing.assert_allclose((ac_ts, ai_ts, angle_deg), sides, rtol=0.0, atol=CLOSED_MM)
    assert ai[1] < 0.0


def test_the_scapula_frame_of_a_scapula_in_its_own_frame_is_the_identity():
    AC, TS, AI = np.array([[5.0, 6.0, 7.0], [-95.0, 6.0, 7.0], [-120.0, -100.0, 7.0]])
    np.testing.assert_allclose(scapula_frame(AC, TS, AI), np.eye(3), rtol=0.0, atol=1e-15)


def test_das3_hangs_its_scapula_at_aa():
    """Check that DAS3's "AC" is AA, to the printed 0.1 mm: its clavicle frame is along SC-AC, off this point."""
    R_thorax_clavicle = clavicle_frame(DSEM_SC, DSEM_AC, np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(DAS3_SC + R_thorax_clavicle @ DAS3_ACROMION, DSEM_AA, rtol=0.0, atol=0.1)


def test_das3s_attachments_are_a_conoid_apart_from_the_ac_joint_and_not_from_aa():
    on_clavicle, on_scapula = das3_conoid_mm()
    from_aa = on_scapula - AC_JOINT_MM + DSEM_AA
    assert np.linalg.norm(on_scapula - on_clavicle) == pytest.approx(17.4, abs=DAS3_OPEN_MM)
    assert np.linalg.norm(from_aa - on_clavicle) > 2.0 * 17.4


def test_das3_closes_where_its_cadaver_was_measured():
    """Check two contact points on the ellipsoid, and the conoid, in the frames of Appendix A."""
    residuals = constraint_residuals_mm(load_model("das3").girdle, jnp.asarray(COMPLETED["das3"].rest_deg) / DEG)
    np.testing.assert_allclose(residuals, 0.0, rtol=0.0, atol=DAS3_OPEN_MM)
    off = ", ".join(f"{x:+.1f}" for x in residuals)
    assert f"A1-A3 are {off} mm there" in load_model("das3").source["scapula.conoid_mm"]


def test_the_conoid_is_slack_in_the_mri():
    model = load_model("breteler_mri")
    at = landmarks(model.girdle, jnp.asarray(COMPLETED["breteler_mri"].rest_deg) / DEG)
    apart = float(jnp.linalg.norm(at.scapula_conoid - at.clavicle_conoid))
    assert apart < 17.4
    assert f"{apart:.1f} mm apart" in model.source["scapula.conoid_mm"]


def test_both_sets_of_one_cadaver_have_the_same_attachments():
    """Check attachments relative to the lengths of clavicle and scapular spine, which differ by measurement."""
    one, other = (load_model(name).girdle for name in ("breteler_dissection", "breteler_mri"))
    for attachment, length in (("clavicle_conoid_mm", "ac_mm"), ("scapula_conoid_mm", "ts_mm")):
        shares = [np.asarray(getattr(g, attachment)) / np.linalg.norm(getattr(g, length)) for g in (one, other)]
        np.testing.assert_allclose(*shares, rtol=0.0, atol=CLOSED_MM)


@pytest.mark.parametrize("name", CLOSED_AT_REST)
def test_the_conoid_hangs_at_rest(name):
    girdle = load_model(name).girdle
    at = landmarks(girdle, jnp.asarray(COMPLETED[name].rest_deg) / DEG)
    hanging = np.array([0.0, -float(girdle.conoid_length_mm), 0.0])
    np.testing.assert_allclose(at.scapula_conoid - at.clavicle_conoid, hanging, rtol=0.0, atol=2.0 * CLOSED_MM)


@pytest.mark.parametrize("name", model_names())
def test_ts_and_ai_are_not_inside_the_thorax(name):
    girdle = load_model(name).girdle
    assert float(girdle.ts_distance_mm) >= 0.0
    assert float(girdle.ai_distance_mm) >= 0.0


def test_a_set_that_rests_outside_in_the_mean_posture_rests_there():
    np.testing.assert_array_equal(COMPLETED["R6"].rest_deg, REST_DEG)
    for name in ("R2", "R4"):
        assert np.abs(COMPLETED[name].rest_deg - REST_DEG).max() > ROUNDED_DEG


@pytest.mark.parametrize("name", THESIS_SETS)
def test_no_posture_nearby_keeps_the_distances_and_is_closer_to_the_mean_one(name):
    """Check random postures around the found one, many of which have TS and AI far enough outside."""
    least = 15.0
    girdle = COMPLETED[name].girdle
    found = own_rest_deg(girdle, (least, least))
    near = found[:, None] + np.random.default_rng(1).normal(scale=1.0, size=(6, 20_000))
    outside = jax.tree.map(lambda x: np.asarray(x)[..., None], replace(girdle, **dict.fromkeys(_DISTANCES, least)))
    off = np.asarray(constraint_residuals_mm(outside, near / DEG))[:2].min(axis=0)
    closest = np.linalg.norm(near - REST_DEG[:, None], axis=0)[off >= 0.0].min()
    assert np.linalg.norm(found - REST_DEG) < closest + np.sqrt(6.0) * ROUNDED_DEG


def test_a_rule_moves_what_it_says():
    """Check a conoid turned forward by 90 deg at rest: it points forward (-z) if the clavicle's axis is level."""
    turned = table_sets(Rule(least_mm=None, forward_deg=90.0))[0]
    moved = table_sets(Rule(sc_mm=(30.3, -8.2, 12.4), least_mm=None))[0]
    at = landmarks(turned.girdle, jnp.asarray(turned.rest_deg) / DEG)
    assert (at.scapula_conoid - at.clavicle_conoid)[2] < -0.8 * float(turned.girdle.conoid_length_mm)
    np.testing.assert_allclose(moved.girdle.sc_mm - turned.girdle.sc_mm, [10.0, 0.0, 0.0], atol=CLOSED_MM)


@pytest.mark.parametrize("name", model_names())
def test_every_shipped_conoid_closes_in_some_posture(name):
    girdle = load_model(name).girdle
    assert shortest_conoid_mm(girdle) < float(girdle.conoid_length_mm)


def test_the_shortest_conoid_is_reached_in_line():
    """|u| = 60 mm, |v| = 45 mm: side by side in one line the attachments are 15 mm apart."""
    zero, length = jnp.zeros(3), jnp.asarray(20.0)
    girdle = Girdle(
        *(zero, jnp.full(3, 100.0), zero, jnp.array([160.0, 0.0, 0.0]), jnp.array([100.0, 0.0, 0.0])),
        *(zero, zero, jnp.array([-45.0, 0.0, 0.0]), length, length, length),
    )
    at = landmarks(girdle, jnp.zeros(6))
    in_line = jnp.linalg.norm(at.scapula_conoid - at.clavicle_conoid)
    assert shortest_conoid_mm(girdle) == pytest.approx(float(in_line)) == pytest.approx(15.0)


@pytest.mark.parametrize("name", model_names())
def test_the_own_values_are_within_their_bounds(name):
    model = load_model(name)
    own_mm = np.asarray(model.girdle.adapted_mm)
    assert len(ADAPTED) == len(own_mm)
    assert np.all(model.bounds_mm[0] < own_mm)
    assert np.all(own_mm < model.bounds_mm[1])
