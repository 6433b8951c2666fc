"""Beliefs about the unexplained part: noise alone, a smooth part of each person, and one that all persons share."""

from dataclasses import replace

import numpy as np
import pytest
from oracles import bones
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp
from small_worlds import CANDIDATES, searched, simulated

from adapt.diagnosis import diagnose
from adapt.diagnosis.fit.discrepancy import NOTHING_OF, Belief
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference import selection
from adapt.diagnosis.inference.alternatives import JOINTS
from adapt.diagnosis.inference.amplitude import amplitudes
from adapt.diagnosis.inference.search import Search, search_of
from adapt.diagnosis.inference.selection import contradiction_deg, standing
from adapt.diagnosis.inference.weights import weigh
from adapt.diagnosis.result import NONE, UNKNOWN, CauseAmplitude, Interval
from models import load_model
from models.effects import EFFECTS
from motions.table import Motions

BIAS = "scapula_landmark_bias"


def test_v_is_the_evidence_of_all_beliefs_by_their_weights():
    """Check V against the weighted sum of the evidence over the beliefs, integrated over their hyperparameters.

    The prior expects two of the 4 candidates, and an unlisted cause is as probable as two listed ones.
    """
    search = searched(BIAS)
    node, candidates = search.best, search.joint.candidates
    at, where = node.posterior, candidates.where(node.hypothesis)
    here = candidates.among_all(node.hypothesis, at.amplitude)
    weights, values = [], []
    for left, discrepancy, log_volume in search.beliefs:
        evidence = Likelihood.of(search.joint, discrepancy).evidence(
            at.theta_mm, at.y, at.Z, np.arange(len(here)), here
        )
        given = evidence.given(where, here[where], candidates.mean[where], candidates.scale[where])
        commons = sum(one.left == "common" for one in search.beliefs)
        weights.append(0.25 / commons if left == "common" else 1.0)
        values.append(given.log_evidence + log_volume)
    expected = logsumexp(values, b=np.array(weights) / sum(weights)) + len(node.hypothesis) * np.log(0.5)
    assert node.value == pytest.approx(expected, rel=1e-9)
    assert search.log_odds == pytest.approx(np.log(0.5))


def test_each_belief_has_none_of_what_the_next_has():
    for left, discrepancy, _ in searched(BIAS).beliefs:
        assert all((getattr(discrepancy, name) == 0.0) == (name in NOTHING_OF[left]) for name in NOTHING_OF["noise"])


def test_of_a_cause_of_the_list_nothing_is_left_and_of_one_outside_it_all():
    """Check the unexplained share with a listed cause and with an unlisted one.

    The unlisted one bends up and down with elevation, alike in all persons, by 6 degrees in the protraction of the
    clavicle and the lateral rotation of the scapula, as no candidate does.
    """
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


def test_what_was_measured_stands_and_constants_where_little_is_left(monkeypatch):
    """Check the causes that stand in a rejected set: measured ones, and constants where the best set leaves little.

    Angles alone do not show a movement; positions do.
    """
    gap, spin = "scapulothoracic_gap", "clavicle_frame_bias"
    named = spin, BIAS, gap
    common = next(one.discrepancy for one in searched(BIAS).beliefs if one.left == "common")
    nothing = Belief("common", common._replace(common_deg=3.0))

    sizes = amplitudes(searched(BIAS), named, frozenset())

    def sizes_from(low: float) -> None:
        """Replace the sizes by some whose intervals begin here."""
        found = {name: replace(one, size=Interval(1.0, low, 2.0)) for name, one in sizes.items()}
        monkeypatch.setattr(selection, "amplitudes", lambda *_: found)

    def after(best_deg: float, seen: frozenset[str] = frozenset(), probable: float = 0.9) -> tuple[str, ...]:
        best = Belief("common", common._replace(common_deg=best_deg))
        search = replace(searched(BIAS), beliefs=(best, nothing), known=(spin,))
        return standing(search, named, seen, dict.fromkeys(named, probable), contradicted=False)

    sizes_from(0.1)
    assert after(0.5) == (spin, BIAS)
    assert after(0.5, probable=0.8) == (spin,)
    assert after(2.9) == (spin,)
    assert after(2.9, frozenset({gap})) == (spin, gap)
    assert after(0.5, frozenset(JOINTS)) == named, "both joints are seen to move: what else gives way is told"
    assert after(0.5, frozenset(JOINTS[:1])) == (spin, BIAS)
    assert after(2.9, frozenset(JOINTS)) == (spin,)
    sizes_from(-0.1)
    assert after(0.5, frozenset(JOINTS)) == (spin,), "a size that may be 0 says nothing"
    sizes_from(0.1)
    monkeypatch.setattr(CauseAmplitude, "too_large", True)
    assert after(0.5) == (spin, BIAS), "a frame may be turned by any angle"
    monkeypatch.setattr(selection, "FRAMES", ())
    assert after(0.5) == (spin,)


def with_landmarks(motions: Motions, angles_deg: np.ndarray) -> Search:
    """Lay out a search with measured SC, AC, TS and AI of R2 at ``angles_deg``, with noise of a millimetre."""
    base, shake = bones(load_model("R2").girdle), np.random.default_rng(2)
    R_C, R_S = (Rotation.from_euler("YZX", one, degrees=True).as_matrix() for one in np.split(angles_deg, 2, 1))
    SC = np.tile(base.sc_mm, (len(angles_deg), 1))
    AC = SC + R_C @ base.ac_mm
    places = {"SC": SC, "AC": AC, "TS": AC + R_S @ base.ts_mm, "AI": AC + R_S @ base.ai_mm}
    seen = {name: place + shake.standard_normal(place.shape) for name, place in places.items()}
    shoulders, _ = usable(replace(motions, landmarks_mm=seen))
    candidates = [EFFECTS[name] for name in CANDIDATES]
    return search_of(load_model("R2"), shoulders, candidates, position_noise_mm=1.0)


def test_angles_that_are_too_large_contradict_the_landmarks_and_nothing_stands():
    """Check a clavicle protraction that is a third too large: no frame turns so, and no joint moves."""
    motions = simulated().motions
    wrong = motions.angles_deg * np.array([1.35, 1.0, 1.0, 1.0, 1.0, 1.0])
    search = with_landmarks(replace(motions, angles_deg=wrong), motions.angles_deg).run()
    assert weigh(search).unexplained > 0.9
    assert contradiction_deg(search)
    assert standing(search, search.best.hypothesis, set(CANDIDATES), {}, contradiction_deg(search) > 0.0) == ()


@pytest.mark.parametrize("off_deg", [0.0, 8.0])
def test_one_person_whose_angles_contradict_the_landmarks_is_unknown(off_deg):
    """Check a scapula whose measured tipping is too large in one motion and too small in the other."""
    of_one = simulated().motions
    of_one = of_one.select(of_one.subject == of_one.subject[0])
    wrong = of_one.angles_deg.copy()
    wrong[:, 5] += np.where(of_one.motion == of_one.motion[0], off_deg, -off_deg)
    shown = with_landmarks(replace(of_one, angles_deg=wrong), of_one.angles_deg).joint.shoulders.motions
    found = diagnose(shown, load_model("R2"), effects=[EFFECTS[name] for name in CANDIDATES])["R2"]
    assert found.verdict.answer == (UNKNOWN if off_deg else NONE)
    assert ("contradict" in found.positions.note) == bool(off_deg)


@pytest.mark.parametrize("carried", [True, False], ids=["carried", "on the bone"])
def test_whether_a_marker_carries_the_landmarks_of_the_scapula_is_told_by_what_turns_its_frame(carried):
    """Check a scapula frame turned by 8 degrees in its bone: carried landmarks turn with it, those on the bone do
    not."""
    motions, turned = simulated().motions, Rotation.from_rotvec([8.0, 0.0, 0.0], degrees=True)
    measured = motions.angles_deg.copy()
    of_scapula = Rotation.from_euler("YZX", measured[:, 3:], degrees=True) * turned
    measured[:, 3:] = of_scapula.as_euler("YZX", degrees=True)
    search = with_landmarks(replace(motions, angles_deg=measured), measured if carried else motions.angles_deg).run()
    rows, candidates = search.joint.positions, search.joint.candidates
    assert rows is not None
    assert bool(np.all(rows.by_amplitude[..., candidates.where([BIAS])] == 0.0)) == carried
    assert BIAS in search.best.hypothesis
    assert not contradiction_deg(search)
    assert weigh(search).unexplained < 0.5
