"""The studies of trust: shares of variance between sets and subjects, and folds of one motion for another."""

import numpy as np
import pytest
from handmade import adaptations, motions_of, rising

from models import load_model
from motions import Motions
from scripts.research.trust import study_heldout, study_sets

ROUNDING = 1e-12


def test_variance_is_shared_out_as_by_hand():
    """A set effect of -+1 and subject effects of -+2, nothing else: shares 1 / 5 and 4 / 5."""
    values = np.array([[-1.0], [1.0]]) + np.array([[-2.0, 2.0]])
    assert study_sets.variance_shares(values) == pytest.approx((0.2, 0.8, 0.0), abs=ROUNDING)
    values[0, 0] += 4.0
    assert sum(study_sets.variance_shares(values)) == pytest.approx(1.0)
    assert study_sets.variance_shares(values)[2] > 0.0


def test_what_all_subjects_share_depends_on_the_set_alone():
    """All subjects have the same motion."""
    made = adaptations(motions_of(rising(2, 4)), [load_model(name) for name in study_sets.SETS])
    agreement = study_sets.agreement_table(made.parameters, made.summary).splitlines()
    (M_y,) = (line for line in agreement if line.startswith("| M_y, mm"))
    assert "| 100 % | 0 % | 0 % |" in M_y


def test_the_sets_are_compared_by_their_gap_held_out_too():
    """Held-out gaps: R4 is 1 degree worse than R2 and R6, and s2 is 3 degrees worse than s1 with every set."""
    made = adaptations(motions_of(rising(2, 4)), [load_model(name) for name in study_sets.SETS])
    summary = made.summary
    for bone in ("clavicle", "scapula"):
        summary[f"{bone}_held_out_deg"] += 1.0 * (summary["model"] == "R4") + 3.0 * (summary["subject"] == "s2")
    lines = study_sets.agreement_table(made.parameters, summary).splitlines()
    for bone in ("clavicle", "scapula"):
        (held_out,) = (line for line in lines if line.startswith(f"| {bone}, gap held out, deg "))
        # SDs of 0, 1, 0 and of 0, 3; sums of squares 2 (2/3) and 6 (9/4).
        assert held_out.endswith("| 0.6 | 2.1 | 9 % | 91 % | 0 % |")
        assert (
            sum(line.startswith(f"| {bone}, gap {state}, deg ") for line in lines for state in ("before", "after")) == 2
        )


def test_a_fold_of_one_motion_for_another_is_of_those_who_have_both():
    motions = Motions.concatenate([motions_of(rising(2, 6)), motions_of(rising(1, 6), motion="flexion")])
    (fold,) = study_heldout.one_motion_for_another(motions, "abduction", "flexion")
    assert (fold.subject, fold.kind, fold.held_out) == (0, study_heldout.ONLY, "flexion")
    assert set(motions.motion[fold.fitted]) == {"abduction"}
    assert set(motions.motion[fold.tested]) == {"flexion"}
