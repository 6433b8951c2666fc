"""Hypotheses fitted to what was observed: misfit, most probable parameters, linear model, evidence, noise."""
