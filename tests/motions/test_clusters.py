# pyright: reportGeneralTypeIssues=false
# (pandas says "Series | scalar" of nearly every result)
"""Clusters: angles are exact where the skin does not move on the bone, or moves as the calibration assumes."""

import numpy as np
import pytest
from laboratory import in_laboratory, simulated_trial, trc_lines
from scipy.spatial.transform import Rotation

from motions import InputError, read_trial
from motions.errors import InputWarning
from motions.formats.any_file import read_any, read_calibration
from motions.formats.marker_files.trc import read_trc
from motions.landmarks.acromion import KOLZ
from motions.landmarks.clusters.calibration import calibrate
from motions.landmarks.clusters.carried_columns import HUMERUS_PLACED, SCAPULA_FROM, residual_column
from motions.landmarks.clusters.rigid_fit import Pose, fit_rigid, part_of_the_way
from motions.landmarks.estimated_landmarks import KAPTEIN_GH
from motions.landmarks.frames import humerus_frame, scapula_frame
from motions.landmarks.mapping import Mapping, read_mapping
from motions.landmarks.sampled_postures import SLIPPED, Labels

EXACT = 1e-6
"""Tolerance in degrees, with positions written to 17 digits."""

REST, RAISED = 12.0, 118.0
ELEVATIONS = np.concatenate([np.linspace(5.0, 125.0, 25), np.linspace(125.0, 5.0, 25)])
Z_UP = Rotation.from_euler("X", 90, degrees=True).as_matrix()
SHAPES_MM = {
    "scapula": np.array([[-10.0, 8.0, 5.0], [20.0, 12.0, -9.0], [5.0, 30.0, 12.0], [-4.0, 15.0, 31.0]]),
    "thorax": np.array([[0.0, -40.0, -12.0], [45.0, -70.0, -20.0], [-40.0, -75.0, -18.0]]),
    "humerus": np.array([[30.0, -90.0, 10.0], [42.0, -130.0, -20.0], [36.0, -160.0, 25.0]]),
}
"""Markers of each cluster in the frame of its segment, mm."""
CLUSTERS = {segment: tuple(f"{segment[:2]}{k}" for k in range(len(shape))) for segment, shape in SHAPES_MM.items()}
MAPPING = Mapping(clusters=CLUSTERS)
LABELS = Labels("P01", "abduction")
PALPATED = ("IJ", "PX", "C7", "T8", "SC", "AC", "TS", "AI", "AA", "GH", "EM", "EL")


def with_clusters(elevation_deg, lag=False, side="right", which=CLUSTERS):
    """Return the landmarks of a simulated trial in a laboratory, and the markers of its clusters.

    lag: the skin of the acromion rotates about an axis outside the bone by a tenth of the elevation, and shifts along
    it.
    """
    trial = simulated_trial(elevation_deg)
    bone = {"thorax": np.repeat(np.eye(3)[..., None], len(elevation_deg), axis=2)}
    bone["scapula"] = scapula_frame(*(trial.thorax_mm[name] for name in ("AC", "TS", "AI")))
    bone["humerus"] = humerus_frame(*(trial.thorax_mm[name] for name in ("GH", "EM", "EL")))
    origin = {"thorax": trial.thorax_mm["IJ"], "scapula": trial.thorax_mm["AC"], "humerus": trial.thorax_mm["GH"]}
    axis, centre = np.array([0.6, -0.48, 0.64]), np.array([-30.0, -20.0, 8.0])
    lag_deg, lag_mm = (share * lag * elevation_deg for share in (0.1, 0.075))
    turn = Rotation.from_rotvec(np.deg2rad(lag_deg)[:, None] * axis)
    markers = {}
    for segment, names in which.items():
        for name, place in zip(names, SHAPES_MM[segment], strict=True):
            own = np.repeat(place[:, None], len(elevation_deg), axis=1)
            if segment == "scapula":
                own = centre[:, None] + turn.apply(place - centre).T + axis[:, None] * lag_mm
            markers[name] = origin[segment] + np.einsum("ijn,jn->in", bone[segment], own)
    everything = trial.thorax_mm | markers
    if side == "left":
        everything = {name: place * np.array([-1.0, 1.0, 1.0])[:, None] for name, place in everything.items()}
    return trial, in_laboratory(everything, Z_UP, np.array([300.0, -500.0, 1200.0]))


def written(folder, name, lab, names):
    path = folder / name
    path.write_text("\n".join(trc_lines({one: lab[one] for one in names})) + "\n")
    return path


def markers_of(which=CLUSTERS):
    return [name for names in which.values() for name in names]


def static(folder, at_deg, **options):
    """Write a static trial of three frames with all landmarks and markers."""
    _, lab = with_clusters(np.full(3, at_deg), **options)
    return written(folder, f"static{at_deg:g}.trc", lab, [*PALPATED, *markers_of()])


def worst(motions, trial):
    """Return the largest error of the angles, except the estimated one, degrees."""
    return np.abs(np.delete(motions.angles_deg - trial.angles_deg[motions.posture - 1], 2, axis=1)).max()


@pytest.mark.parametrize("side", ["right", "left"])
def test_without_a_lag_the_angles_are_those_of_the_bones(tmp_path, side):
    """The moving trial has only the markers of the clusters."""
    trial, lab = with_clusters(ELEVATIONS, side=side)
    moving = written(tmp_path, "moving.trc", lab, markers_of())
    labels = Labels("P01", "abduction", side)
    calibration = read_calibration([static(tmp_path, REST, side=side)], MAPPING, labels)
    motions = read_any(moving, MAPPING, labels, calibration)
    assert worst(motions, trial) < EXACT
    assert np.abs(motions.humerus_elevation_deg - trial.elevation_deg).max() < EXACT
    assert set(motions.extra[SCAPULA_FROM]) == {"cluster, calibrated in one posture"}
    for segment in CLUSTERS:
        assert motions.extra[residual_column(segment)].astype(float).max() < 1e-9


@pytest.mark.parametrize("elbow", ["cluster", "landmarks"])
def test_double_calibration_takes_a_lag_that_is_linear_in_elevation_away(tmp_path, elbow):
    """The lag is 12 degrees and 9 mm over the motion; with one static posture it remains in the angles.

    Without a cluster on the humerus, GH moves with the scapula, whose position depends on the elevation computed from
    GH.
    """
    which = CLUSTERS if elbow == "cluster" else {name: CLUSTERS[name] for name in ("scapula", "thorax")}
    names = [*markers_of(which), *(() if elbow == "cluster" else ("EM", "EL"))]
    mapping = Mapping(clusters=which)

    trial, lab = with_clusters(ELEVATIONS, lag=True)
    moving = written(tmp_path, "moving.trc", lab, names)
    statics = [static(tmp_path, at, lag=True) for at in (RAISED, REST, 60.0)]
    both = read_any(moving, mapping, LABELS, read_calibration(statics[:2], mapping, LABELS))
    assert worst(both, trial) < EXACT
    assert set(both.extra[SCAPULA_FROM]) == {"cluster, calibrated at 12, 118 degrees"}
    three = read_any(moving, mapping, LABELS, read_calibration(statics, mapping, LABELS))
    assert worst(three, trial) < EXACT
    one = read_any(moving, mapping, LABELS, read_calibration(statics[1:2], mapping, LABELS))
    assert worst(one, trial) > 5.0


def test_a_landmark_that_only_one_static_trial_has(tmp_path):
    """The second posture needs only AC, TS and AI of the scapula, and of the thorax only the cluster."""
    trial, lab = with_clusters(ELEVATIONS)
    moving = written(tmp_path, "moving.trc", lab, markers_of())
    _, raised = with_clusters(np.full(3, RAISED))
    few = written(tmp_path, "raised.trc", raised, ["AC", "TS", "AI", *markers_of()])
    calibration = read_calibration([static(tmp_path, REST), few], MAPPING, LABELS)
    motions = read_any(moving, MAPPING, LABELS, calibration)
    assert worst(motions, trial) < EXACT
    fewer = written(tmp_path, "raised.trc", raised, ["AC", "TS", *markers_of()])
    with pytest.raises(InputError, match=r"at 118 degrees only AC, TS of the scapula.*Palpate AC, TS and AI"):
        read_calibration([static(tmp_path, REST), fewer], MAPPING, LABELS)


def test_a_cluster_with_a_gap_and_one_with_swapped_markers(tmp_path):
    """A cluster of four works with three markers; frames with a swap are named and left out."""
    trial, lab = with_clusters(ELEVATIONS)
    lab["sc1"][:, 7] = np.nan
    lab["th0"][:, 3:6], lab["th1"][:, 3:6] = lab["th1"][:, 3:6].copy(), lab["th0"][:, 3:6].copy()
    moving = written(tmp_path, "moving.trc", lab, markers_of())
    calibration = read_calibration([static(tmp_path, REST)], MAPPING, LABELS)
    with pytest.warns(InputWarning) as said:
        motions = read_any(moving, MAPPING, LABELS, calibration)
    assert any("cluster thorax has not its shape in 3 frames, 4 to 6" in str(one.message) for one in said)
    assert sorted(set(range(1, 51)) - set(motions.posture.tolist())) == [4, 5, 6]
    assert worst(motions, trial) < EXACT


def test_the_residual_at_sampled_elevations(tmp_path):
    """Noise of 1 mm (SD per coordinate) on every marker: of 12 coordinates of four markers, 6 determine the pose."""
    rng = np.random.default_rng(3)
    _, lab = with_clusters(np.linspace(5.0, 125.0, 400))
    noisy = {name: place + rng.standard_normal(place.shape) for name, place in lab.items()}
    moving = written(tmp_path, "moving.trc", noisy, markers_of())
    labels = Labels("P01", "abduction", at_deg=(30.0, 60.0, 90.0))
    motions = read_any(moving, MAPPING, labels, read_calibration([static(tmp_path, REST)], MAPPING, labels))
    assert motions.extra[residual_column("scapula")].astype(float).mean() == pytest.approx(np.sqrt(6.0 / 4.0), rel=0.2)


def test_what_a_calibration_lacks_is_said(tmp_path):
    """Each refusal names the cluster or landmark, and the remedy."""
    _, lab = with_clusters(ELEVATIONS)
    moving = written(tmp_path, "moving.trc", lab, markers_of())
    whole = static(tmp_path, REST)
    with pytest.raises(InputError, match=r"no markers for landmarks IJ.*Clusters carry them with --static"):
        read_any(moving, MAPPING, LABELS)
    with pytest.raises(InputError, match=r"does not say which markers are clusters.*\[clusters\]"):
        read_calibration([whole], Mapping(), LABELS)
    wrong = Mapping(clusters={"scapula": ("sc0", "sc1", "scX")})
    with pytest.raises(InputError, match="no markers sc0, sc1, scX of cluster scapula together"):
        read_calibration([whole], wrong, LABELS)
    line = Mapping(clusters={"scapula": ("AC", "AC2", "AC3")})
    straight = {f"AC{k}": lab["AC"] + k * np.array([[10.0], [0.0], [0.0]]) for k in (2, 3)} | {"AC": lab["AC"]}
    with pytest.raises(InputError, match="markers lie in a line"):
        calibrate([read_trc(written(tmp_path, "line.trc", straight, list(straight)))], line, "right")
    only = Mapping(clusters={"scapula": CLUSTERS["scapula"]})
    with pytest.raises(InputError, match="landmarks IJ, PX, C7, T8 are neither in the trial nor carried"):
        read_any(moving, only, LABELS, read_calibration([whole], only, LABELS))
    other = written(tmp_path, "other.trc", lab, [*PALPATED, *CLUSTERS["thorax"]])
    with pytest.raises(InputError, match=r"cluster scapula is in no frame: there is no marker sc0, sc1, sc2, sc3"):
        read_any(other, only, LABELS, read_calibration([whole], only, LABELS))


def test_a_static_trial_in_which_the_arm_moves(tmp_path):
    """A file of several palpated postures is refused, because their positions must not be averaged."""
    _, lab = with_clusters(np.linspace(10.0, 90.0, 5))
    path = written(tmp_path, "all.trc", lab, [*PALPATED, *markers_of()])
    with pytest.raises(
        InputError, match=r"the arm moves by 72 degrees in this static trial\. Give each posture a file"
    ):
        read_calibration([path], MAPPING, LABELS)


def test_a_persons_prefix_before_the_markers_of_a_cluster(tmp_path):
    """QTM writes such prefixes; the trial has no landmarks."""
    trial, lab = with_clusters(ELEVATIONS)
    moving = written(
        tmp_path,
        "moving.trc",
        {f"P01_{name}": xyz for name, xyz in lab.items()},
        [f"P01_{name}" for name in markers_of()],
    )
    motions = read_any(moving, MAPPING, LABELS, read_calibration([static(tmp_path, REST)], MAPPING, LABELS))
    assert worst(motions, trial) < EXACT


def test_far_beyond_the_static_postures_is_warned_of(tmp_path):
    _, lab = with_clusters(ELEVATIONS)
    moving = written(tmp_path, "moving.trc", lab, markers_of())
    statics = [static(tmp_path, REST), static(tmp_path, 60.0)]
    with pytest.warns(InputWarning, match=r"65 degrees beyond the static postures \(12 to 60\)"):
        read_any(moving, MAPPING, LABELS, read_calibration(statics, MAPPING, LABELS))


def test_gh_that_nobody_palpated_is_marked(tmp_path):
    """GH is placed in the static trial and moves with the humerus; angles that depend on it are marked."""
    trial, lab = with_clusters(ELEVATIONS)
    moving = written(tmp_path, "moving.trc", lab, markers_of())
    _, still = with_clusters(np.full(3, REST))
    without = written(tmp_path, "static.trc", still, [*(n for n in PALPATED if n != "GH"), *markers_of()])
    labels = Labels("P01", "abduction", gh_from_ac=KAPTEIN_GH)
    motions = read_any(moving, MAPPING, labels, read_calibration([without], MAPPING, labels))
    assert set(motions.extra[HUMERUS_PLACED]) == {"GH from AC by a stated offset +- 10 mm"}
    assert "GH" not in motions.landmarks_mm
    assert worst(motions, trial) < EXACT
    assert np.abs(motions.humerus_elevation_deg - trial.elevation_deg).max() < 5.0


@pytest.mark.parametrize("side", ["right", "left"])
def test_gh_from_ac_of_a_trial_without_clusters(tmp_path, side):
    """With the cadaver's own offset GH is exact; the elevation error is within the stated uncertainty."""
    trial, lab = with_clusters(ELEVATIONS, side=side)
    path = written(tmp_path, "trial.trc", lab, [name for name in PALPATED if name != "GH"])
    labels = Labels("P01", "abduction", side, gh_from_ac=KAPTEIN_GH)
    motions = read_any(path, Mapping(), labels)
    assert set(motions.extra[HUMERUS_PLACED]) == {"GH from AC by a stated offset +- 10 mm"}
    assert "GH" not in motions.landmarks_mm
    assert worst(motions, trial) < EXACT
    assert np.abs(motions.humerus_elevation_deg - trial.elevation_deg).max() < 5.0
    with pytest.warns(InputWarning, match="GH was measured, so --gh-from-ac changes nothing"):
        measured = read_any(written(tmp_path, "all.trc", lab, PALPATED), Mapping(), labels)
    assert HUMERUS_PLACED not in measured.extra
    without = written(tmp_path, "aa.trc", lab, [name for name in PALPATED if name not in ("GH", "AC")])
    aa_only = Labels("P01", "abduction", side, aa_to_ac=KOLZ, aa_to_ac_name="kolz2020", gh_from_ac=KAPTEIN_GH)
    with pytest.warns(InputWarning, match="GH cannot be placed, as AC was not measured"):
        found = read_any(without, Mapping(), aa_only)
    assert HUMERUS_PLACED not in found.extra


def test_from_python(tmp_path):
    """``read_trial`` takes static trials, and the mapping file names the clusters."""
    trial, lab = with_clusters(ELEVATIONS)
    lines = [f"{segment} = [{', '.join(map(repr, names))}]" for segment, names in CLUSTERS.items()]
    (tmp_path / "lab.toml").write_text("[clusters]\n" + "\n".join(lines) + "\n")
    moving = written(tmp_path, "moving.trc", lab, markers_of())
    found = read_trial(moving, tmp_path / "lab.toml", "P01", "abduction", static=[static(tmp_path, REST)])
    assert worst(found, trial) < EXACT
    for at_deg, said in ((60, "60"), ("60", "'60'"), ([60.0, np.nan], "nan"), ([-20.0], "-20"), (["x"], "x")):
        with pytest.raises(InputError, match=rf"at_deg: .*{said}.* is not a list of elevations"):
            read_trial(moving, at_deg=at_deg)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="side is 'up'"):
        read_trial(moving, side="up")  # type: ignore[arg-type]


def test_clusters_that_carry_nothing_are_named(tmp_path):
    _, lab = with_clusters(np.full(3, REST))
    alone = written(tmp_path, "alone.trc", lab, PALPATED)
    with pytest.warns(InputWarning, match=f"carries nothing without --static, and marker {CLUSTERS['scapula'][0]} is"):
        read_any(alone, MAPPING, LABELS)
    read_any(written(tmp_path, "static.trc", lab, [*PALPATED, *markers_of()]), MAPPING, LABELS)  # no warning


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[clusters]\nclavicle = ["a", "b", "c"]', "no cluster 'clavicle'.*thorax, scapula, humerus"),
        ('[clusters]\nscapula = ["a", "b"]', "has not 3 different markers"),
        ('[clusters]\nscapula = ["a", "b", "b", "c"]', "has not 3 different markers"),
        ('[clusters]\nscapula = "a"', "not a list of markers"),
        ("clusters = 3", "clusters is not a section"),
    ],
)
def test_a_mapping_with_wrong_clusters(tmp_path, text, said):
    (tmp_path / "lab.toml").write_text(text)
    with pytest.raises(InputError, match=said):
        read_mapping(tmp_path / "lab.toml")


def test_the_rigid_fit_is_scipys():
    """Compared with scipy's align_vectors, with noise."""
    rng = np.random.default_rng(1)
    shape = rng.normal(0.0, 20.0, (5, 3))
    R = Rotation.from_rotvec(rng.normal(0.0, 1.0, (6, 3)))
    seen = np.stack([R.apply(place).T for place in shape]) + rng.normal(0.0, 2.0, (5, 3, 6)) + 100.0
    fit = fit_rigid(shape, seen)
    for k in range(6):
        about = seen[..., k] - seen[..., k].mean(axis=0)
        expected, rssd, *_ = Rotation.align_vectors(about, shape - shape.mean(axis=0))
        np.testing.assert_allclose(fit.pose.R[..., k], expected.as_matrix(), atol=1e-9)
        assert fit.residual_mm[k] == pytest.approx(rssd / np.sqrt(5.0))


def test_parts_of_a_motion_make_the_whole():
    """Ten tenths of a screw motion give the screw; for a rotation about a point, the point stays."""
    R = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()[..., None]
    whole = Pose(R, np.array([[10.0], [-4.0], [7.0]]))
    tenth = part_of_the_way(whole, np.array([0.1]))
    found = tenth
    for _ in range(9):
        found = tenth.after(found)
    np.testing.assert_allclose(found.R, whole.R, atol=1e-12)
    np.testing.assert_allclose(found.t, whole.t, atol=1e-12)
    centre = np.array([[5.0], [60.0], [-2.0]])
    about = Pose(R, centre - np.einsum("ijn,jn->in", R, centre))
    np.testing.assert_allclose(part_of_the_way(about, np.array([0.37])).carry(centre), centre, atol=1e-12)
    straight = Pose(np.eye(3)[..., None], np.array([[3.0], [4.0], [5.0]]))
    np.testing.assert_allclose(part_of_the_way(straight, np.array([0.5])).t, straight.t / 2.0, atol=1e-14)


def changed_static(folder, name, at_deg, **places):
    """Write a static trial with landmarks or markers at other places."""
    _, lab = with_clusters(np.full(3, at_deg))
    return written(folder, name, lab | {one: place(lab) for one, place in places.items()}, [*PALPATED, *markers_of()])


def ghost_of(name, away_mm):
    return lambda lab: lab[name] + np.array([[away_mm], [0.0], [0.0]])


@pytest.mark.parametrize(
    ("places", "said"),
    [
        ({"TS": lambda lab: 0.0 * lab["TS"]}, "landmark TS was never seen"),
        ({"TS": lambda lab: lab["AI"], "AI": lambda lab: lab["TS"]}, "Are TS and AI swapped"),
        ({"AI": ghost_of("AI", 300.0)}, "AI cannot be right"),
    ],
)
def test_what_was_palpated_wrong_is_named_in_the_static_trial(tmp_path, places, said):
    path = changed_static(tmp_path, "wrong.trc", REST, **places)
    with pytest.raises(InputError, match=said) as caught:
        read_calibration([path], MAPPING, LABELS)
    assert caught.value.file == str(path)


def test_two_postures_of_one_scapula_have_its_shape(tmp_path):
    """AI palpated 40 mm off with the arm raised: the message blames no correct landmark."""
    path = changed_static(tmp_path, "raised.trc", RAISED, AI=ghost_of("AI", 40.0))
    with pytest.raises(InputError, match=r"AI .*cannot be right: AI and (AC|TS|AA) are") as caught:
        read_calibration([static(tmp_path, REST), path], MAPPING, LABELS)
    assert caught.value.file == str(path)
    assert "palpate AI" in caught.value.remedy


def test_one_palpated_frame_that_jumps_does_not_count(tmp_path):
    trial, lab = with_clusters(ELEVATIONS)

    def jumping(lab):
        return lab["AI"] + np.array([0.0, 200.0, 0.0])

    calibration = read_calibration([changed_static(tmp_path, "jumps.trc", REST, AI=jumping)], MAPPING, LABELS)
    assert (
        worst(read_any(written(tmp_path, "moving.trc", lab, markers_of()), MAPPING, LABELS, calibration), trial) < EXACT
    )


@pytest.mark.parametrize("value", [0.0, -16512.0, "held"])
def test_a_marker_of_a_cluster_that_was_never_seen_is_a_gap(tmp_path, value):
    """The three other markers carry the scapula."""
    trial, lab = with_clusters(ELEVATIONS)
    lab["sc0"] = (
        np.repeat(lab["sc0"][:, :1], len(ELEVATIONS), axis=1) if value == "held" else np.full_like(lab["sc0"], value)
    )
    calibration = read_calibration([static(tmp_path, REST)], MAPPING, LABELS)
    with pytest.warns(InputWarning, match="marker sc0 of cluster scapula is at .* in frames 1-50. It was not seen"):
        motions = read_any(written(tmp_path, "moving.trc", lab, markers_of()), MAPPING, LABELS, calibration)
    assert worst(motions, trial) < EXACT


def test_a_cluster_that_stands_still_while_the_thorax_moves_is_a_gap(tmp_path):
    trial, lab = with_clusters(ELEVATIONS)
    lab = {name: place + 30.0 * np.sin(np.arange(len(ELEVATIONS)) / 9.0) for name, place in lab.items()}
    for name in CLUSTERS["scapula"]:
        lab[name][:, 20:30] = lab[name][:, 20:21]
    calibration = read_calibration([static(tmp_path, REST)], MAPPING, LABELS)
    with pytest.warns(InputWarning) as said:
        motions = read_any(written(tmp_path, "moving.trc", lab, markers_of()), MAPPING, LABELS, calibration)
    assert sum("of cluster scapula is at" in str(one.message) for one in said) == len(CLUSTERS["scapula"])
    assert len(motions.posture) == len(ELEVATIONS) - 10
    assert worst(motions, trial) < EXACT


def test_skin_that_lags_is_no_slip_of_a_landmark(tmp_path):
    """With one static posture the skin changes the distance from SC to AC: there is no message about SC."""
    _, lab = with_clusters(ELEVATIONS, lag=True)
    calibration = read_calibration([static(tmp_path, REST, lag=True)], MAPPING, LABELS)
    motions = read_any(written(tmp_path, "moving.trc", lab, markers_of()), MAPPING, LABELS, calibration)
    assert SLIPPED not in motions.extra
