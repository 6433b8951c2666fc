"""Hypotheses fitted to what was observed: misfit, most probable parameters, noise, held-out gaps."""
