"""Effects outside the list."""

from dataclasses import replace

import numpy as np

from scripts.research.named_causes.synthetic_a.conventions import ANGLES, DEG, Array
from scripts.research.named_causes.synthetic_a.courses import Change, Draw
from scripts.research.named_causes.synthetic_a.effects_measured import turned
from scripts.research.named_causes.synthetic_a.subjects import Postures


def outside_sign_flip(w: Draw) -> Change:
    """One angle has the wrong sign, about zero or about the subject's own mean; amplitude 1 is the whole flip."""
    column, about = w.pick(
        "flipped", [("scapula_x_deg", "zero"), ("scapula_x_deg", "mean"), ("clavicle_z_deg", "mean")]
    )
    j = ANGLES.index(column)

    def flip(q: Array) -> Array:
        out = q.copy()
        pivot = _subject_mean(q[:, j], w.postures) if about == "mean" else 0.0
        out[:, j] -= 2.0 * w.constant() * (q[:, j] - pivot)
        return out

    return Change(angles=flip)


def outside_mid_winging(w: Draw) -> Change:
    """The scapula wings in mid-range only: internal rotation and forward tipping, a bump of the amplitude, deg."""
    centre, width = w.rng.uniform(65.0, 85.0), w.rng.uniform(15.0, 24.0)
    own = centre + 5.0 * w.rng.standard_normal(w.postures.subjects)
    w.notes |= {"centre_deg_by_subject": own, "width_deg": width}
    bump = np.exp(-0.5 * ((w.postures.elevation_deg - own[w.postures.subject]) / width) ** 2)
    vector = (w.constant() * bump * DEG)[:, None] * w.direction((-0.5, 0.85, 0.0), 0.15)
    return Change(angles=lambda q: turned(q, 1, vector), moves_landmarks="scapula")


def outside_swapped_columns(w: Draw) -> Change:
    """Two columns have changed places; amplitude 1 is the whole swap, less mixes them."""
    pairs = [
        ("scapula_z_deg", "clavicle_z_deg"),
        ("clavicle_x_deg", "scapula_y_deg"),
    ]
    i, j = (ANGLES.index(column) for column in w.pick("swapped", pairs))

    def swap(q: Array) -> Array:
        out = q.copy()
        out[:, i] += w.constant() * (q[:, j] - q[:, i])
        out[:, j] += w.constant() * (q[:, i] - q[:, j])
        return out

    return Change(angles=swap)


def outside_hysteresis(w: Draw) -> Change:
    """One bone is turned one way in one motion and the other way in the next, most in mid-range, deg."""
    bone = w.pick("bone", ["clavicle", "scapula"])
    sign = np.where(w.postures.motion % 2 == 0, 1.0, -1.0)
    arc = 0.5 + 0.5 * np.sin(np.pi * w.postures.elevation_deg / 180.0)
    vector = (w.constant() * sign * arc * DEG)[:, None] * w.direction((0.0, 0.0, 0.0), 1.0)
    return Change(angles=lambda q: turned(q, ("clavicle", "scapula").index(bone), vector))


def outside_crosstalk(w: Draw) -> Change:
    """One angle leaks, squared, into another: amplitude at 20 deg from the source's mean, deg."""
    pairs = [
        ("clavicle_y_deg", "scapula_x_deg"),
        ("scapula_z_deg", "clavicle_z_deg"),
        ("clavicle_x_deg", "scapula_y_deg"),
    ]
    source, target = w.pick("from_to", pairs)
    i, j = ANGLES.index(source), ANGLES.index(target)

    def leak(q: Array) -> Array:
        out = q.copy()
        u = (q[:, i] - _subject_mean(q[:, i], w.postures)) / (20.0 * DEG)
        out[:, j] += w.constant() * DEG * 2.0 * u**2 / (1.0 + u**2)
        return out

    return Change(angles=leak)


def outside_step(w: Draw) -> Change:
    """A marker moves near 90 deg: one bone is turned by a constant rotation from there on, deg.

    Either it slips back with every motion, or it slips once, in the first, and stays for the session.
    """
    bone, mode = w.pick("bone", ["clavicle", "scapula"]), w.pick("slips", ["in every motion", "once"])
    at = 90.0 + 12.0 * w.rng.uniform(-1.0, 1.0, w.postures.subjects)
    w.notes["at_deg_by_subject"] = at
    after = w.postures.elevation_deg > at[w.postures.subject]
    if mode == "once":
        after |= w.postures.motion > 0
    vector = (w.constant() * after * DEG)[:, None] * w.direction((0.0, 0.0, 0.0), 1.0)
    return Change(angles=lambda q: turned(q, ("clavicle", "scapula").index(bone), vector))


def outside_drift(w: Draw) -> Change:
    """One angle drifts with the number of the posture, over all motions of the session, deg at the last."""
    j = ANGLES.index(w.pick("angle", ["clavicle_z_deg", "scapula_y_deg", "scapula_x_deg"]))
    power = w.rng.uniform(0.6, 1.8)
    w.notes["power"] = power
    more = (w.constant() * DEG * w.postures.session**power)[:, None] * np.eye(6)[j]
    return Change(angles=lambda q: q + more)


def outside_breathing(w: Draw) -> Change:
    """The thorax becomes deeper and shallower with the breath, which knows nothing of the arm: half the swing, mm."""
    turns, phase = w.rng.uniform(2.2, 4.4), w.rng.uniform(0.0, 2.0 * np.pi, w.postures.subjects)
    w.notes |= {"breaths_a_session": turns, "phase_rad_by_subject": phase}
    swing = w.constant() * np.sin(2.0 * np.pi * turns * w.postures.session + phase[w.postures.subject])
    more = swing[:, None] * np.array([0.3, 0.0, 1.0])
    return Change(chain=lambda c: replace(c, semi=c.semi + more))


def outside_gain(w: Draw) -> Change:
    """One angle is too large by a factor, as after a wrong calibration, %."""
    j = ANGLES.index(w.pick("angle", ["clavicle_y_deg", "clavicle_z_deg", "scapula_y_deg"]))
    factor = 1.0 + (w.constant() / 100.0)[:, None] * np.eye(6)[j]
    return Change(angles=lambda q: q * factor)


def _subject_mean(value: Array, postures: Postures) -> Array:
    """Compute each subject's mean of a value (n,), repeated for each of its postures (n,)."""
    total = np.bincount(postures.subject, value, postures.subjects)
    return (total / np.bincount(postures.subject, minlength=postures.subjects))[postures.subject]
