"""Fits of the girdle to measured motions, postures and subjects, and the diagnosis of the gap that they leave."""

from adapt.api import Adaptations, PostureFits, adapt_subjects, fit_postures
from adapt.assessment import Trust, assess_trust
from adapt.diagnosis import Diagnosis, diagnose

__all__ = [
    "Adaptations",
    "Diagnosis",
    "PostureFits",
    "Trust",
    "adapt_subjects",
    "assess_trust",
    "diagnose",
    "fit_postures",
]
