"""The gap between the adapted girdle and the measurement: where it lies, which effect causes it, how far it shrinks."""

from adapt.diagnosis.diagnosis import Changed, Diagnosis, diagnose
from adapt.diagnosis.inference.amplitude import Amplitude

__all__ = ["Amplitude", "Changed", "Diagnosis", "diagnose"]
