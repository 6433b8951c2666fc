"""Reasons why a probable cause is not named: the step that left it out."""

from adapt.diagnosis.inference.computed_axial_rotation import ESTIMATE
from adapt.diagnosis.inference.not_named import (
    NOT_NEEDED,
    OF_ESTIMATE,
    OWN_BONES_DO,
    PERSONS_DIFFER,
    UNEXPLAINED,
    why_not_named,
)
from adapt.diagnosis.inference.selection import probable

BIAS, GAP, TILT, SPIN = "scapula_landmark_bias", "scapulothoracic_gap", "thorax_tilt", "clavicle_frame_bias"


def test_the_reason_is_the_step_at_which_a_cause_was_left_out():
    named = (SPIN, f"{GAP}:posture")
    causes = {f"{GAP}:posture": GAP, TILT: TILT, SPIN: SPIN}
    inclusion = {GAP: 0.9, TILT: 0.85, SPIN: 0.95, "sc_offset": 0.1}
    assert why_not_named(inclusion, causes, named, (), (SPIN,), doubt="") == {
        GAP: OWN_BONES_DO,
        TILT: NOT_NEEDED,
        SPIN: PERSONS_DIFFER,
    }
    assert GAP not in why_not_named(inclusion, causes, named, (f"{GAP}:posture",), (SPIN,), doubt="")
    rejected = why_not_named(inclusion, causes, named, (), (SPIN,), doubt=UNEXPLAINED)
    assert set(rejected.values()) == {UNEXPLAINED}
    computed = why_not_named(inclusion, causes, named, (), (SPIN,), doubt=UNEXPLAINED, known=(ESTIMATE,))
    assert computed == rejected | {SPIN: OF_ESTIMATE}


def test_a_cause_that_is_hardly_active_in_any_set_is_not_named():
    causes = {BIAS: BIAS, f"{GAP}:posture": GAP}
    assert probable((BIAS, f"{GAP}:posture"), {BIAS: 0.01, GAP: 0.9}, causes) == (f"{GAP}:posture",)
