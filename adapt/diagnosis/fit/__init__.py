"""Fits of hypotheses (sets of causes): misfit, posterior modes, linear model, evidence, noise."""
