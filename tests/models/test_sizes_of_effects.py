"""Size of every varying effect under its prior, on measured postures, against the literature, by independent code."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from models.effects import EFFECTS
from models.effects.effect import cause_of
from motions import Motions, read_motions

SHARED = sorted(Path("../shared/motions").glob("bonepin*.csv"))

RMS = {
    "ac_translation": 2.06,  # mm: Sahara 2006, 1.5 back and 1 up; pins of others 0.8-1.9
    "sc_translation": 2.08,  # mm: pins of four shoulders 1.2-2.1, of two 1.7-3.7
    "scapulothoracic_gap": 3.6,  # mm: TS 2 and AI 3
    "conoid_strain": 0.8,  # mm: pins of four shoulders 0.7
    "thorax_extension": 3.3,  # deg: 1.7 with one arm, 4.3 with both
    "skin_artefact": 4.5,  # deg: Cereatti 2017 5.3, others 2.8
    "clavicle_axial_estimate": 5.0,  # deg: 2.9-7.1
}
"""Root mean square of the whole vector beyond a constant of each subject; conversions: see the effects' sources."""

DRAWS = 4000

WITHIN = 0.1
"""Relative tolerance: 4000 draws of a few normal numbers have an error of 1-2 %; the rest is for rounded figures."""

HANGING_DEG = {"clavicle_y": -28.57, "clavicle_z": 11.68, "scapula_y": 32.05, "scapula_z": 10.67, "scapula_x": -10.32}

FLEXION = np.array([[0, 20, 40, 60, 80, 100, 120, 140], [0, 6, 10, 12, 14, 16, 17, 20]])
ABDUCTION = np.array([[0, 20, 40, 60, 80, 100], [0, 2.8, 5.3, 7.9, 10.7, 13.8]])
"""Cereatti 2017: elevation and lag, deg."""


def bone_pins() -> list[Path]:
    if not SHARED:
        pytest.skip("the measured motions of ../shared are not here")
    return SHARED


MEASURED = {"shipped": lambda: [Path("motions/data/simulated_subjects.csv")], "bone pins": bone_pins}


def over_elevation(table: pd.DataFrame, late: bool) -> np.ndarray:
    f = table["humerus_elevation_deg"].fillna(0.0).to_numpy() / 150.0
    return np.stack([f * f if late else f, 4 * f * (1 - f), 8 * f * (1 - f) * (1 - 2 * f)])


def lag(table: pd.DataFrame) -> np.ndarray:
    """Return the lag along one direction of each subject; its length beyond a constant is then that of the lag."""
    elevation = table["humerus_elevation_deg"].fillna(0.0)
    sideways = table["motion"].str.lower().str.contains("frontal|abduction")
    return np.where(sideways, np.interp(elevation, *ABDUCTION), np.interp(elevation, *FLEXION))[None]


def terms(name: str, table: pd.DataFrame) -> np.ndarray:
    """Return the terms (terms, postures) that the amplitudes of one direction multiply, the same for all directions."""
    if name == "skin_artefact":
        return lag(table)
    if name.endswith(":posture"):
        followed = EFFECTS[cause_of(name)].may_follow
        return np.stack([(table[f"{angle}_deg"] - HANGING_DEG[angle]).to_numpy() / 30.0 for angle in followed])
    return over_elevation(table, name in {"conoid_strain", "clavicle_axial_estimate"})


@pytest.mark.parametrize("measured", MEASURED)
@pytest.mark.parametrize("name", [name for name, effect in EFFECTS.items() if effect.basis.word])
def test_an_effect_drawn_from_its_prior_is_as_large_as_the_literature_says(name, measured):
    files = MEASURED[measured]()
    table = pd.concat([pd.read_csv(file) for file in files], ignore_index=True)
    mean, sd = EFFECTS[name].amplitude_prior(Motions.concatenate([read_motions(file) for file in files]))
    drawn = mean + sd * np.random.default_rng(1).standard_normal((DRAWS, len(sd)))
    course = pd.DataFrame(terms(name, table).T)
    beyond = (course - course.groupby(table["subject"]).transform("mean")).to_numpy()
    strengths = drawn.reshape(DRAWS, -1, beyond.shape[1]) @ beyond.T
    found = np.sqrt((strengths**2).sum(axis=1).mean(axis=1))
    assert np.sqrt((found**2).mean()) == pytest.approx(RMS[cause_of(name)], rel=WITHIN)


def test_postures_that_hardly_differ_do_not_make_an_effect_large():
    """Check elevations within a degree, over which no measured joint moves by 2 mm."""
    every = read_motions("motions/data/simulated_subjects.csv")
    high = every.select(every.humerus_elevation_deg == every.humerus_elevation_deg.max())
    mean, sd = EFFECTS["ac_translation"].amplitude_prior(high)
    np.testing.assert_array_equal(mean, 0.0)
    assert sd[:3] == pytest.approx(1.0 / 0.12 / np.hypot(1.0, np.hypot(0.3, 0.2)) * np.array([1.0, 0.3, 0.2]))
