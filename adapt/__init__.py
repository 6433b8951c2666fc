"""Posture fits, adaptation to subjects, and diagnosis of the gap that remains.

Public names are imported on first use, so that shell completion, which needs none of them, does not wait for JAX.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from adapt.api import Adaptations, PostureFits, adapt_subjects, fit_postures
    from adapt.diagnosis import Diagnosis, diagnose
    from adapt.evaluation.model_subjects import Simulated, simulate_model_subjects
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

_HOMES = {
    "adapt.api": ("Adaptations", "PostureFits", "adapt_subjects", "fit_postures"),
    "adapt.diagnosis": ("Diagnosis", "diagnose"),
    "adapt.evaluation.model_subjects": ("Simulated", "simulate_model_subjects"),
    "adapt.trust.assessment": ("Trust", "assess_trust"),
}


def __getattr__(name: str) -> Any:
    home = next((module for module, names in _HOMES.items() if name in names), None)
    if home is None:
        raise AttributeError(f"module 'adapt' has no attribute {name!r}")
    return getattr(importlib.import_module(home), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
