"""The plain chain, A1-A3 of a girdle without effects: Newton with derivatives by hand, many problems at once."""

from adapt.solvers.newton.postures import fit_postures as fit_postures
from adapt.solvers.newton.postures import track_postures as track_postures
from adapt.solvers.newton.subjects import fit_subjects as fit_subjects
