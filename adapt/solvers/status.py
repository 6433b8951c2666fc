"""One word for how a fit ended, in every table and result."""

OK = "ok"
UNREACHABLE = "unreachable"
"""The chain cannot be closed near this posture: the constraint residuals say how far it is open."""
NOT_CONVERGED = "not_converged"
"""The solver stopped before its tolerances: the result is not an optimum."""
INVALID = "invalid"
"""The input does not determine a result."""
