"""The gap between the adapted girdle and the measurement: where it lies, which effect causes it, how far it shrinks."""

from adapt.diagnosis.diagnosis import diagnose
from adapt.diagnosis.result import Diagnoses, Diagnosis

__all__ = ["Diagnoses", "Diagnosis", "diagnose"]
