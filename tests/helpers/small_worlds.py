"""Small simulated worlds for the diagnosis: few subjects, one parameter set, made once per process."""

from dataclasses import replace
from functools import cache

import numpy as np

from adapt.diagnosis.fit.evidence import Given
from adapt.diagnosis.fit.joint_fit import JointFit
from adapt.diagnosis.fit.search_folds import folds_of
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.search import Search, search_of
from adapt.evaluation.model_subjects import Simulated, simulate_model_subjects
from models import load_model
from models.effects import EFFECTS
from motions.table import ANGLES, Motions

CANDIDATES = ("clavicle_frame_bias", "scapula_landmark_bias", "scapulothoracic_gap", "thorax_tilt")
"""Few candidates, so that their machine code compiles quickly."""

HAVE_STRENGTHS = (
    "scapulothoracic_gap",
    "conoid_strain",
    "ac_translation",
    "sc_translation",
    "thorax_asymmetry",
    "thorax_tilt",
    "scapula_landmark_bias",
    "thorax_extension",
    "clavicle_axial_estimate",
    "skin_artefact",
)
"""Effects of the reference worlds that the library can apply with the same strengths."""


@cache
def simulated(
    effect: str = "", subjects: int = 3, noise_deg: float = 0.3, seed: int = 7, size: float = 1.0
) -> Simulated:
    """Simulate subjects with R2, with no active effect or one of ``size`` times its typical size."""
    return simulate_model_subjects(load_model("R2"), EFFECTS.get(effect), subjects, noise_deg, seed, size)


def every_frame(motions: Motions, times: int) -> Motions:
    """Repeat every posture ``times`` times with separate noise, as in a trial with all its frames."""
    rows = np.repeat(np.arange(len(motions.posture)), times)
    noise_deg = 0.3 * np.random.default_rng(3).standard_normal((len(rows), len(ANGLES)))
    return replace(
        motions,
        subject=motions.subject[rows],
        motion=motions.motion[rows],
        posture=np.arange(len(rows)),
        humerus_elevation_deg=motions.humerus_elevation_deg[rows],
        angles_deg=motions.angles_deg[rows] + noise_deg,
        landmarks_mm={},
        extra=motions.extra.iloc[rows].reset_index(drop=True),
    )


@cache
def joint_fit(effect: str = "") -> JointFit:
    """Lay out the joint fit of such a world with ``CANDIDATES``."""
    shoulders, _ = usable(simulated(effect).motions)
    return search_of(load_model("R2"), shoulders, [EFFECTS[name] for name in CANDIDATES]).joint


def root_of(given: Given) -> np.ndarray:
    """Return L of the precision L L' of the amplitudes, with every shoulder counted once."""
    return given.amplitude_of(np.ones(len(given.rest)))[1]


@cache
def searched(effect: str = "") -> Search:
    """Search the causes of such a world."""
    joint = joint_fit(effect)
    return Search(joint, folds_of(joint.shoulders)).run()
