"""A small checkout of Spartacus with invented numbers: contents that are read, corrected, or left out with a reason."""

from pathlib import Path

import numpy as np
import pytest
from command import girdle

from motions import InputError, read_motions
from motions.formats.spartacus import is_spartacus, read_spartacus
from motions.landmarks.acromion import KOLZ, ac_from_aa_deg
from motions.landmarks.sampled_postures import SCAPULA_ROTATED, Labels

EXACT = 1e-9
ARM = np.arange(20.0, 121.0, 10.0)
AC, AA = "vec(TS>AC)", "vec(TS>AA)"
THORAX = "vec((T8+PX)/2>(C7+IJ)/2)"

# ISB's alpha, beta, gamma over the arm's angle: invented, with the signs of a right shoulder.
CURVES = {
    "SC_protraction": -20.0 - 0.15 * ARM,
    "SC_elevation": -8.0 - 0.08 * ARM,
    "SC_rotation": 0.2 * ARM,
    "ST_protraction": 40.0 - 0.05 * ARM,
    "ST_medRotation": -5.0 - 0.35 * ARM,
    "ST_tilt": -10.0 + 0.1 * ARM,
}
EXPECTED = np.stack([c * s for c, s in zip(CURVES.values(), [1, -1, 1, 1, -1, 1], strict=True)], axis=1)
LABELS = Labels("", "", aa_to_ac=KOLZ, aa_to_ac_name="kolz2020")


def study(number: int, authors: str, scapula: str = AC, thorax: str = THORAX, side_as_right: str = "True") -> str:
    return f"#{number},{authors},2009,{thorax},{scapula},{side_as_right}"


def joint(number: int, authors: str, joint: str, shoulder: str, files: list[str], motion="frontal plane elevation",
          sequence="yx'z''", side="right") -> str:  # fmt: skip
    folder = f"#{number}_{authors.split()[0]}_et_al"
    return f"#{number},{authors},{motion},{joint},{sequence},{shoulder},{side},{folder},{','.join(files)}"


def joints(number: int, authors: str, shoulder: str = "", swapped: bool = False, **kind: str) -> list[str]:
    tail = f"_{shoulder}.csv" if shoulder else ".csv"
    clavicle = [f"{name}{tail}" for name in ("SC_protraction", "SC_elevation", "SC_rotation")]
    if swapped:
        clavicle[:2] = clavicle[1::-1]
    scapula = [f"{name}{tail}" for name in ("ST_protraction", "ST_medRotation", "ST_tilt")]
    return [
        joint(number, authors, "sternoclavicular", shoulder, clavicle, **kind),
        joint(number, authors, "scapulothoracic", shoulder, scapula, **kind),
    ]


def data(folder: Path, number: int, authors: str, shoulder: str = "", arm=ARM, turned: tuple[str, ...] = ()) -> Path:
    where = folder / "spartacus" / "data" / f"#{number}_{authors.split()[0]}_et_al"
    where.mkdir(parents=True, exist_ok=True)
    tail = f"_{shoulder}.csv" if shoulder else ".csv"
    for name, angle in CURVES.items():
        values = np.interp(np.abs(arm), ARM, angle) * (-1.0 if name in turned else 1.0)
        (where / f"{name}{tail}").write_text(
            "".join(f"{a!r},{v!r}\n" for a, v in zip(arm.tolist(), values.tolist(), strict=True))
        )
    return where


def checkout(folder: Path, studies: list[str], rows: list[str]) -> Path:
    tables = folder / "spartacus" / "dataset"
    tables.mkdir(parents=True, exist_ok=True)
    head = "dataset_id,dataset_authors,dataset_year,thorax_y_direction,scapula_z_direction,side_as_right"
    (tables / "dataset_of_datasets.csv").write_text("\n".join([head, *studies]) + "\n")
    head = "dataset_id,dataset_authors,humeral_motion,joint,euler_sequence,shoulder_id,side,folder,"
    head += "dof_1st_euler,dof_2nd_euler,dof_3rd_euler"
    (tables / "dataset_clean_of_joint_data.csv").write_text("\n".join([head, *rows]) + "\n")
    return folder


def test_a_study_in_isbs_sequence_through_ac(tmp_path):
    authors = "Ludewig et al."
    data(tmp_path, 11, authors)
    folder = checkout(tmp_path, [study(11, authors)], joints(11, authors))
    assert is_spartacus(folder)
    motions = read_spartacus(folder, Labels("", ""))
    assert motions.subjects == ("ludewig2009_mean",)
    assert set(motions.motion) == {"frontal_elevation"}
    np.testing.assert_allclose(motions.humerus_elevation_deg, ARM)
    np.testing.assert_allclose(motions.angles_deg, EXPECTED, rtol=0.0, atol=EXACT)
    assert SCAPULA_ROTATED not in motions.extra
    assert motions.rejected == ()


def test_aa_needs_the_stated_rotation_and_gets_it_the_right_way_round(tmp_path):
    authors = "Oki et al."
    data(tmp_path, 16, authors)
    folder = checkout(tmp_path, [study(16, authors, AA)], joints(16, authors))
    with pytest.raises(InputError, match="goes through AA, not AC") as caught:
        read_spartacus(folder, Labels("", ""))
    assert "--aa-to-ac kolz2020" in caught.value.remedy
    motions = read_spartacus(folder, LABELS)
    np.testing.assert_allclose(motions.angles_deg[:, 3:], ac_from_aa_deg(EXPECTED[:, 3:], KOLZ), rtol=0.0, atol=EXACT)
    assert (motions.angles_deg[:, 3] > EXPECTED[:, 3] + 5.0).all()  # AC is in front of AA
    assert set(motions.extra[SCAPULA_ROTATED]) == {"AA brought to AC by kolz2020 +- 4 deg"}


@pytest.mark.parametrize("listed", [True, False])
def test_upward_rotation_of_moissenet_is_turned_round_once_listed_or_not(tmp_path, listed):
    """These files have the opposite sign, and `corrections.csv` lists only the files of the elevations."""
    authors = "Moissenet et al."
    dense = np.linspace(20.0, 120.0, 1500)
    where = data(tmp_path, 14, authors, "6", dense, turned=("ST_medRotation",))
    if listed:
        (where / "corrections.csv").write_text("ST_medRotation_6.csv,-1\n")
    rows = joints(14, authors, "6") + joints(14, authors, "6", motion="horizontal flexion")
    motions = read_spartacus(checkout(tmp_path, [study(14, authors)], rows), Labels("", ""))
    assert motions.subjects == ("moissenet2009_6",)
    assert list(dict.fromkeys(motions.motion)) == ["frontal_elevation", "horizontal_flexion"]
    for motion in ("frontal_elevation", "horizontal_flexion"):
        np.testing.assert_allclose(motions.select(motions.motion == motion).angles_deg, EXPECTED, rtol=0.0, atol=1e-6)
    assert set(motions.humerus_elevation_deg[motions.motion == "horizontal_flexion"]) == {90.0}


def test_swapped_columns_of_the_clavicle_are_known_by_their_names(tmp_path):
    authors = "Matsuki et al."
    data(tmp_path, 12, authors)
    folder = checkout(tmp_path, [study(12, authors)], joints(12, authors, swapped=True))
    np.testing.assert_allclose(read_spartacus(folder, LABELS).angles_deg, EXPECTED, rtol=0.0, atol=EXACT)


def test_isbs_negative_elevations_and_the_collections_own_corrections(tmp_path):
    authors = "Someone else"
    where = data(tmp_path, 3, authors, arm=-ARM, turned=("SC_rotation",))
    (where / "corrections.csv").write_text("SC_rotation.csv,-1\n")
    motions = read_spartacus(checkout(tmp_path, [study(3, authors)], joints(3, authors)), LABELS)
    np.testing.assert_allclose(motions.humerus_elevation_deg, ARM)
    np.testing.assert_allclose(motions.angles_deg, EXPECTED, rtol=0.0, atol=EXACT)


def test_a_scapula_that_rotates_the_wrong_way_is_refused(tmp_path):
    authors = "Someone else"
    data(tmp_path, 3, authors, turned=("ST_medRotation",))
    with pytest.raises(InputError, match="rotates medially while the arm is raised"):
        read_spartacus(checkout(tmp_path, [study(3, authors)], joints(3, authors)), LABELS)


def test_what_is_left_out_is_named_and_the_rest_is_read(tmp_path):
    good, bad = "Ludewig et al.", "Matsuki et al."
    data(tmp_path, 11, good)
    studies = [
        study(1, "Begon et al."),
        study(12, bad, "x^y", "imaging inferosuperior axis"),
        study(7, "Karduna et al.", side_as_right="False"),
        study(11, good),
        study(4, "Fung et al."),
    ]
    rows = [
        *joints(1, "Begon et al.", sequence="zy'x''"),
        *joints(7, "Karduna et al."),
        *joints(11, good),
        *joints(4, "Fung et al.")[1:],
    ]
    folder = checkout(tmp_path, studies, rows)
    ended = girdle("convert", folder, tmp_path / "out.csv")
    assert ended.status == 3
    assert len(ended.messages) == 4
    for words in ("Begon et al.: sternoclavicular: zy'x'' instead of", "Matsuki et al.: the frame of its thorax",
                  "Karduna et al.: its left shoulders", "Fung et al.: sternoclavicular: no angles"):  # fmt: skip
        assert words in ended.err
    np.testing.assert_allclose(read_motions(tmp_path / "out.csv").angles_deg, EXPECTED, rtol=0.0, atol=EXACT)


def test_a_file_that_is_not_there(tmp_path):
    authors = "Ludewig et al."
    where = data(tmp_path, 11, authors)
    (where / "ST_tilt.csv").unlink()
    folder = checkout(tmp_path, [study(11, authors)], joints(11, authors))
    with pytest.raises(InputError, match="cannot be read"):
        read_spartacus(folder, LABELS)


@pytest.mark.parametrize("table", ["dataset_of_datasets", "dataset_clean_of_joint_data"])
def test_a_column_that_is_missing_is_named(tmp_path, table):
    """Regression test for a fault found by fuzzing."""
    authors = "Ludewig et al."
    data(tmp_path, 11, authors)
    folder = checkout(tmp_path, [study(11, authors)], joints(11, authors))
    path = folder / "spartacus" / "dataset" / f"{table}.csv"
    path.write_text(path.read_text().replace("dataset_id", "number", 1))
    with pytest.raises(InputError, match="line 1: there is not one column dataset_id"):
        read_spartacus(folder, LABELS)


def test_a_curve_without_a_whole_row_is_named(tmp_path):
    """Regression test for a fault found by fuzzing."""
    authors = "Ludewig et al."
    where = data(tmp_path, 11, authors)
    folder = checkout(tmp_path, [study(11, authors)], joints(11, authors))
    (where / "SC_elevation.csv").write_text("20,nan\n40,\n")
    with pytest.raises(InputError, match="no row of the file has both numbers"):
        read_spartacus(folder, LABELS)
