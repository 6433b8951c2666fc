"""Any chain, with effects too: projections onto the constraints, Gauss-Newton steps around them; and what Newton
leaves."""

from adapt.solvers.projection.postures import close_chains as close_chains
from adapt.solvers.projection.postures import fit_postures as fit_postures
from adapt.solvers.projection.subjects import fit_subjects as fit_subjects
