"""Solvers for any chain, with effects too: projections onto the constraints with Gauss-Newton steps around them. They
also continue where Newton has not converged."""

from adapt.solvers.projection.postures import close_chains as close_chains
from adapt.solvers.projection.postures import fit_postures as fit_postures
from adapt.solvers.projection.subjects import fit_subjects as fit_subjects
