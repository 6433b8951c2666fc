"""Fits of the girdle to measured motions, postures and subjects, and the diagnosis of the gap that they leave."""

from adapt.api import Adaptations, PostureFits, adapt_subjects, fit_postures
from adapt.diagnosis import Diagnosis, diagnose
from adapt.model_subjects import Simulated, simulate_model_subjects
from adapt.trust.assessment import Trust, assess_trust

__all__ = [
    "Adaptations",
    "Diagnosis",
    "PostureFits",
    "Simulated",
    "Trust",
    "adapt_subjects",
    "assess_trust",
    "diagnose",
    "fit_postures",
    "simulate_model_subjects",
]
