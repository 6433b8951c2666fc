"""Diagnosis of the gap between adapted girdle and measurement: its location, its causes and how far it shrinks."""

from adapt.diagnosis.diagnosis import diagnose
from adapt.diagnosis.result import Diagnoses, Diagnosis

__all__ = ["Diagnoses", "Diagnosis", "diagnose"]
