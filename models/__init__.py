"""Differentiable model of the shoulder girdle: geometry, constraints and parameter sets."""

from models.adapted_parameters import ADAPTED_PARAMETERS
from models.parameter_sets import ParameterSet, load_model, model_names

__all__ = ["ADAPTED_PARAMETERS", "ParameterSet", "load_model", "model_names"]
