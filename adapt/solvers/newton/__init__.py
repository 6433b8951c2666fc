"""Solvers for the chain without effects, A1-A3 of a girdle: Newton with hand-written derivatives, many problems at
once."""

from adapt.solvers.newton.postures import fit_postures as fit_postures
from adapt.solvers.newton.postures import track_postures as track_postures
from adapt.solvers.newton.subjects import fit_subjects as fit_subjects
