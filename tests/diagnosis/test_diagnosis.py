# pyright: reportAttributeAccessIssue=false, reportOptionalSubscript=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result; levels are there in these worlds)
"""The whole diagnosis: on a simulated world with one cause, and on the measured shoulders if they are there."""

from dataclasses import replace

import numpy as np
import pytest
from small_worlds import CANDIDATES, simulated

from adapt import adapt_subjects, diagnose
from adapt.diagnosis.notes import notes
from adapt.diagnosis.result import ALL, EFFECT, NONE
from adapt.tables.held_out import MOTION
from models import load_model
from models.effects import EFFECTS
from models.effects.known import read_amplitudes
from motions import read_motions
from motions.landmarks.sampled_postures import SLIPPED
from motions.table import ANGLES

BIAS = "scapula_landmark_bias"

SAME_DEG = 1e-6
"""One meaning of 'adapted': the numbers of the diagnosis are those of `girdle adapt` and `girdle adapt --effect`."""

UNSEEN_DEG = {"breteler_dissection": (1.5, 1.1), "breteler_mri": (1.7, 1.4)}
"""Scapula, clavicle, with the causes that are named, on motions that were not fitted. What a diagnosis must reach to be
of use; set when the sets left 3.0 and 2.6, 2.5 and 2.4 without causes. Completed anew they leave 2.0 and 1.3."""

RATIO, PERSON_DEG = 0.65, 1.25
"""Of the unseen gap of all angles with the causes to that without; and that gap on persons not fitted either."""


@pytest.fixture(scope="module")
def biased():
    return diagnose(simulated(BIAS).motions, load_model("R2"), effects=[EFFECTS[name] for name in CANDIDATES])["R2"]


def test_the_hidden_cause_is_named_and_takes_the_gap_away(biased):
    assert biased.verdict.answer == EFFECT
    assert biased.verdict.names[0] == BIAS
    assert biased.gaps.shrinkage > 0.3
    assert biased.left_over_share < 0.5
    assert sum(biased.verdict.probability.values()) == pytest.approx(1.0)
    steps = [step.step for step in biased.budget]
    assert steps[:3] == ["base", "adapted", "thorax_points"]
    assert biased.verdict.names[-1] == "thorax_points", "R2 has another person's points on the thorax"
    assert "thorax_points=30" in biased.options
    assert steps[-1] == "noise"
    assert BIAS in steps


def test_adapted_means_what_girdle_adapt_reports(biased):
    motions, model = simulated(BIAS).motions, load_model("R2")
    known = read_amplitudes(biased.options)
    for kind, effects in (("adapted", {}), ("with_effect", known)):
        result = adapt_subjects(motions, model, effects=effects)
        rows = result.heldout[result.heldout["kind"] == MOTION]
        found = biased.gaps.other_motion[kind]
        assert found[ALL].value == pytest.approx(rows["gap_unseen_deg"].mean(), abs=SAME_DEG)
        for bone in ("scapula", "clavicle"):
            assert found[bone].value == pytest.approx(rows[f"{bone}_gap_unseen_deg"].mean(), abs=SAME_DEG)
        after = result.fits[result.fits["adapted"] == 1]
        columns = [column for column in after.columns if column.endswith("_difference_deg")]
        each = after[columns].abs().groupby(after["subject"]).mean().mean(axis=1)
        assert biased.gaps.in_sample[kind][ALL].value == pytest.approx(each.mean(), abs=SAME_DEG)


def slipped(degrees: float, mark: str):
    """Nothing hidden, but TS slipped in two postures of each subject: the scapula is turned there by so much about z.
    Landmarks off by centimetres do that."""
    motions = simulated().motions
    rows = np.flatnonzero(np.isin(motions.posture, (3, 4)) & (motions.motion == motions.motion[0]))
    angles_deg, marks = motions.angles_deg.copy(), np.full(len(motions.posture), "", object)
    angles_deg[rows, ANGLES.index("scapula_z")] += degrees
    marks[rows] = mark
    extra = motions.extra.assign(**{SLIPPED: marks})
    return replace(motions, angles_deg=angles_deg, extra=extra), rows


def test_postures_with_a_slip_are_left_out_and_named():
    """Marked, the slips cost their postures; not marked, they spoil the gap and what is said of it."""
    effects, model = [EFFECTS[name] for name in CANDIDATES], load_model("R2")
    motions, rows = slipped(25.0, "TS")
    found = diagnose(motions, model, effects=effects)["R2"]
    without = motions.select(~np.isin(np.arange(len(motions.posture)), rows))
    expected = diagnose(without, model, effects=effects)["R2"]
    assert (found.verdict, found.noise, found.postures) == (expected.verdict, expected.noise, len(without.posture))
    first = motions.subject[rows[0]], motions.motion[rows[0]], motions.posture[rows[0]]
    assert found.slips[0] == "TS slipped in {}, {} {}".format(*first)
    assert len(found.slips) == len(rows)
    assert f"Left out: {found.slips[0]}." in notes(found)
    unmarked = diagnose(slipped(25.0, "")[0], model, effects=effects)["R2"]
    assert unmarked.slips == ()
    assert unmarked.noise.angle_deg > 4.0 * found.noise.angle_deg


def test_nothing_is_found_where_nothing_is_hidden():
    motions = simulated(noise_deg=1.5).motions
    found = diagnose(motions, load_model("R2"), effects=[EFFECTS[name] for name in CANDIDATES])["R2"]
    assert found.verdict.answer == NONE
    assert found.options == ()
    assert "thorax_points" in [step.step for step in found.budget], "it is no answer, and is shown"


def test_points_on_the_thorax_of_the_person_are_not_doubted():
    own = {f"thorax.{key}": "measured: fitted to 60 points; +-2 mm" for key in ("centre_mm", "semi_axes_mm")}
    model = replace(load_model("R2"), source={**load_model("R2").source, **own})
    found = diagnose(simulated(noise_deg=1.5).motions, model, effects=[EFFECTS[BIAS]])["R2"]
    assert "thorax_points" not in [step.step for step in found.budget]
    assert "thorax_points=30" not in found.options


@pytest.mark.parametrize("name", UNSEEN_DEG)
def test_the_causes_of_measured_shoulders_predict_motions_that_were_not_fitted(name, measured_files):
    files = [file for file in measured_files if file.name.startswith("bonepin")]
    found = diagnose(read_motions(*files), load_model(name))[name]
    assert found.verdict.answer == EFFECT
    named = {one for cause in found.verdict.causes for one in cause.names[:1]}
    assert not named & {"skin_artefact", "clavicle_axial_estimate"}, "bone pins exclude them"
    gaps = found.gaps.other_motion["with_effect"]
    for bone, most in zip(("scapula", "clavicle"), UNSEEN_DEG[name], strict=True):
        assert gaps[bone].value <= most
    assert gaps[ALL].value <= RATIO * found.gaps.other_motion["adapted"][ALL].value
    assert found.gaps.other_person["with_effect"][ALL].value <= PERSON_DEG
