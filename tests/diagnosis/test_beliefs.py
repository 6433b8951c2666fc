"""What may be left beside the causes: noise, what each person does, what all do alike."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp
from small_worlds import CANDIDATES, searched, simulated

from adapt.diagnosis import diagnose
from adapt.diagnosis.fit.discrepancy import NOTHING_OF, Belief
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.diagnosis.inference.selection import standing
from adapt.diagnosis.inference.weights import weigh
from models import load_model
from models.effects import EFFECTS

BIAS = "scapula_landmark_bias"


def test_v_is_the_evidence_of_all_beliefs_by_their_weights():
    """Two listed causes are as probable as one that is not, of 4 candidates of which two are expected."""
    search = searched(BIAS)
    node, candidates = search.best, search.joint.candidates
    at, where = node.posterior, candidates.where(node.hypothesis)
    here = candidates.among_all(node.hypothesis, at.amplitude)
    weights, values = [], []
    for left, discrepancy in search.beliefs:
        evidence = Likelihood.of(search.joint, discrepancy).evidence(
            at.theta_mm, at.y, at.Z, np.arange(len(here)), here
        )
        given = evidence.given(where, here[where], candidates.mean[where], candidates.scale[where])
        commons = sum(one.left == "common" for one in search.beliefs)
        weights.append(0.25 / commons if left == "common" else 1.0)
        values.append(given.log_evidence)
    expected = logsumexp(values, b=np.array(weights) / sum(weights)) + len(node.hypothesis) * np.log(0.5)
    assert node.value == pytest.approx(expected, rel=1e-9)
    assert search.log_odds == pytest.approx(np.log(0.5))


def test_each_belief_has_none_of_what_the_next_has():
    for left, discrepancy in searched(BIAS).beliefs:
        assert all((getattr(discrepancy, name) == 0.0) == (name in NOTHING_OF[left]) for name in NOTHING_OF["noise"])


def test_of_a_cause_of_the_list_nothing_is_left_and_of_one_outside_it_all():
    """A course that bends up and down with elevation, alike in all, in the protraction of the clavicle and the lateral
    rotation of the scapula: 6 degrees, as none of the candidates does."""
    assert weigh(searched(BIAS)).unexplained < 0.5
    motions = simulated(subjects=4).motions
    angles = motions.angles_deg.copy()
    waves = 6.0 * np.sin(np.deg2rad(4.0 * motions.humerus_elevation_deg))
    angles[:, 0] += waves
    angles[:, 4] -= waves
    candidates = [EFFECTS[name] for name in CANDIDATES]
    found = diagnose(replace(motions, angles_deg=angles), load_model("R2"), effects=candidates)["R2"]
    assert found.verdict.answer == "unknown"
    assert found.verdict.causes == ()


def test_what_was_measured_stands_and_constants_where_little_is_left():
    """Of angles that no set explains: what moves is told by positions alone."""
    named = (BIAS, "ac_translation:posture", "clavicle_axial_estimate")
    common = next(one.discrepancy for one in searched(BIAS).beliefs if one.left == "common")
    nothing = Belief("common", common._replace(common_deg=3.0))

    def after(best_deg: float, seen: frozenset[str] = frozenset()) -> tuple[str, ...]:
        best = Belief("common", common._replace(common_deg=best_deg))
        search = replace(searched(BIAS), beliefs=(best, nothing), known=("clavicle_axial_estimate",))
        return standing(search, named, seen)

    assert after(0.5) == (BIAS, "clavicle_axial_estimate")
    assert after(2.9) == ("clavicle_axial_estimate",)
    assert after(2.9, frozenset({"ac_translation"})) == ("ac_translation:posture", "clavicle_axial_estimate")
