"""Small simulated worlds for the diagnosis: few subjects, one parameter set, made once a process."""

from functools import cache

from adapt.diagnosis.fit.candidates import lay_out
from adapt.diagnosis.fit.joint_fit import JointFit, Model, everybody
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.fit.unseen_folds import folds_of
from adapt.diagnosis.inference.search import Search
from adapt.model_subjects import Simulated, simulate_model_subjects
from models import load_model
from models.effects import EFFECTS

CANDIDATES = ("clavicle_frame_bias", "scapula_landmark_bias", "scapulothoracic_gap", "thorax_tilt")
"""Few, so that their machine code is soon made."""


@cache
def simulated(effect: str = "", subjects: int = 3, noise_deg: float = 0.3, seed: int = 7) -> Simulated:
    """Simulate subjects with R2, with an effect at work or none."""
    return simulate_model_subjects(load_model("R2"), EFFECTS.get(effect), subjects, noise_deg, seed)


@cache
def joint_fit(effect: str = "") -> JointFit:
    """Lay out the joint fit of such a world with CANDIDATES."""
    shoulders, _ = usable(simulated(effect).motions)
    effects = tuple(EFFECTS[name] for name in CANDIDATES)
    model = Model.of(load_model("R2"), shoulders.subjects, effects)
    return JointFit(model, shoulders, lay_out(effects, shoulders), everybody(shoulders))


@cache
def searched(effect: str = "") -> Search:
    """Search such a world."""
    joint = joint_fit(effect)
    return Search(joint, folds_of(joint.shoulders)).run()
