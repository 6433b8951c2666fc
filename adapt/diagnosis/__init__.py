"""The gap between the adapted girdle and the measurement: where it lies, which effect causes it, how far it shrinks."""

from adapt.diagnosis.amplitude import Amplitude
from adapt.diagnosis.diagnosis import Changed, Diagnosis, diagnose

__all__ = ["Amplitude", "Changed", "Diagnosis", "diagnose"]
