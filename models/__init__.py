"""The differentiable girdle: geometry, constraints, parameter sets."""

from models.parameter_sets import ParameterSet, load_model, model_names

__all__ = ["ParameterSet", "load_model", "model_names"]
