"""Landmarks that a mapping file computes from markers, and estimated landmarks in place of SC and AC."""

from dataclasses import replace

import numpy as np
import pytest

from adapt.diagnosis.marks import angles_are_of_landmarks, declared_effects
from motions import InputError
from motions.errors import InputWarning
from motions.formats.any_file import read_any
from motions.landmarks.acromion import KOLZ
from motions.landmarks.derived import factors_of
from motions.landmarks.estimated_landmarks import KAPTEIN
from motions.landmarks.mapping import Mapping, read_mapping
from motions.landmarks.sampled_postures import CLAVICLE_PLACED, SLIPPED, Labels
from tests.helpers.laboratory import in_laboratory, simulated_trial, trc_lines


@pytest.mark.parametrize(
    ("text", "factors"),
    [
        ("2*centijc7 - ij", {"centijc7": 2.0, "ij": -1.0}),
        ("(a + b)/2", {"a": 0.5, "b": 0.5}),
        ("mean(a, b, 'P 01:c-d')", {"a": 1 / 3, "b": 1 / 3, "P 01:c-d": 1 / 3}),
        ("-a + 2 * mean(a, b)", {"a": 0.0, "b": 1.0}),
        ("P01:IJ*0.25 + .75*x.2", {"P01:IJ": 0.25, "x.2": 0.75}),
    ],
)
def test_formulas(text, factors):
    assert factors_of(text) == pytest.approx(factors)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a + b", "sum to 2"),
        ("2*a - b + 1", "1 is added to it"),
        ("a * b", "by a number"),
        ("a / 0", "by a number"),
        ("(a + b)/2 c", "not expected"),
        ("mean(a, b", "not closed"),
        ("a +", "breaks off"),
        ("a ? b", "cannot be read"),
        ("* a", "not expected"),
    ],
)
def test_what_is_no_formula_says_why(text, said):
    with pytest.raises(ValueError, match=said):
        factors_of(text)


@pytest.fixture(scope="module")
def lab() -> dict[str, np.ndarray]:
    trial = simulated_trial(np.linspace(5.0, 125.0, 9))
    return in_laboratory(trial.thorax_mm, np.eye(3)[[2, 0, 1]], np.array([300.0, -500.0, 1200.0]))


def read(tmp_path, lab, mapping: str, **labels):
    path = tmp_path / "trial.trc"
    path.write_text("\n".join(trc_lines(lab)) + "\n")
    names = tmp_path / "lab.toml"
    names.write_text(mapping)
    return read_any(path, read_mapping(names), Labels("P01", "abduction", **labels))


def test_a_thorax_of_midpoints_gives_the_same_angles(tmp_path, lab):
    plain = read(tmp_path, lab, "")
    others = {name: xyz for name, xyz in lab.items() if name not in ("PX", "T8", "C7", "IJ")}
    others |= {"ij": lab["IJ"], "centijc7": (lab["IJ"] + lab["C7"]) / 2, "cent-px": (lab["PX"] + lab["T8"]) / 2}
    mapping = '[markers]\nIJ = "ij"\nC7 = "2*centijc7 - ij"\nPX_T8 = "cent-px"\n'
    derived = read(tmp_path, others, mapping)
    np.testing.assert_allclose(derived.angles_deg, plain.angles_deg, atol=1e-9)


@pytest.mark.parametrize(
    ("mapping", "said"),
    [
        ('C7 = "2*nobody - IJ"', "there is no marker 'nobody' for landmark C7"),
        ('C7 = "IJ + T8"', "sum to 2"),
        ('PX_T8 = "PX"\nT8 = "T8"', "stands for T8"),
        ('XY = "PX"', "no landmark 'XY'"),
    ],
)
def test_a_wrong_formula_is_one_message(tmp_path, lab, mapping, said):
    with pytest.raises(InputError, match=said):
        read(tmp_path, lab, f"[markers]\n{mapping}\n")


TWO_ESTIMATED_DEG = 6.0
"""Limit between a clavicle of two estimated landmarks and the true one: each is 10 mm off a clavicle of 158 mm."""


def test_a_trial_without_sc_and_ac_has_a_clavicle_that_says_so(tmp_path, lab):
    true = read(tmp_path, lab, "")
    without = {name: xyz for name, xyz in lab.items() if name not in ("SC", "AC")}
    found = read(tmp_path, without, "", aa_to_ac=KOLZ, aa_to_ac_name="kolz2020", sc_from_ij=KAPTEIN)
    off = found.angles_deg[:, :2] - true.angles_deg[:, :2]
    assert np.abs(off).max() < TWO_ESTIMATED_DEG
    assert "SC" not in found.landmarks_mm
    assert found.extra[CLAVICLE_PLACED].str.contains("SC from IJ").all()
    assert found.extra[CLAVICLE_PLACED].str.contains("AC from AA").all()
    estimated, turned, placed = "clavicle_axial_estimate", "scapula_landmark_bias", "clavicle_frame_bias"
    assert declared_effects(found) == (estimated, turned, placed), "each once, whatever was placed"
    assert declared_effects(true) == (estimated,)
    assert angles_are_of_landmarks(true)
    for word, said in (("Yes", True), ("TRUE", True), ("1", True), ("no", False), ("", False)):
        by_hand = replace(true, extra=true.extra.assign(angles_from_landmarks=word))
        assert angles_are_of_landmarks(by_hand) is said, "in a file of a person's own"
    with pytest.warns(InputWarning, match="SC was not found, so the angles of the clavicle stay empty"):
        empty = read(tmp_path, without, "", aa_to_ac=KOLZ, aa_to_ac_name="kolz2020")
    assert np.isnan(empty.angles_deg[:, :2]).all()
    assert CLAVICLE_PLACED not in empty.extra


def test_a_landmark_that_slipped_is_marked_in_its_posture(tmp_path, lab):
    assert SLIPPED not in read(tmp_path, lab, "").extra
    slipped = {name: xyz.copy() for name, xyz in lab.items()}
    along = lab["TS"][:, 4] - lab["AI"][:, 4]
    slipped["TS"][:, 4] += 8.0 * along / np.linalg.norm(along)
    marks = read(tmp_path, slipped, "").extra[SLIPPED].tolist()
    assert marks == ["", "", "", "", "TS", "", "", "", ""]
    slipped["TS"][:, 4] += 8.0 * along / np.linalg.norm(along)
    with pytest.warns(InputWarning) as caught:
        found = read(tmp_path, slipped, "")
    assert "TS is not in its place in frame 5, by up to 16 mm" in str(caught[0].message)
    assert "They have gaps in TS" in str(caught[1].message)
    assert found.posture.tolist() == [1, 2, 3, 4, 6, 7, 8, 9]


def test_names_with_signs_stay_names(tmp_path, lab):
    renamed = {f"m-{name}": xyz for name, xyz in lab.items()}
    mapping = "[markers]\n" + "".join(f'{name} = "m-{name}"\n' for name in lab)
    np.testing.assert_allclose(
        read(tmp_path, renamed, mapping).angles_deg, read(tmp_path, lab, "").angles_deg, atol=1e-12
    )


def test_the_mapping_without_a_file_names_itself():
    assert Mapping().marker("PX") == "PX"
