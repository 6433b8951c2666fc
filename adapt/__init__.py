"""Fits of the girdle to measured motions: postures, subjects."""

from adapt.api import Adaptations, PostureFits, adapt_subjects, fit_postures

__all__ = ["Adaptations", "PostureFits", "adapt_subjects", "fit_postures"]
