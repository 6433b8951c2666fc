"""One word for how a fit ended, in every table and result."""

import numpy as np

OK = "ok"
UNREACHABLE = "unreachable"
"""The chain cannot be closed near this posture: the constraint residuals say how far it is open."""
NOT_CONVERGED = "not_converged"
"""The solver stopped before its tolerances: the result is not an optimum."""
INVALID = "invalid"
"""The input does not determine a result."""
UNDERDETERMINED = "underdetermined"
"""Of no posture more than three angles were measured, and the chain follows them exactly: nothing is left to adapt."""

WORDS = np.array([OK, NOT_CONVERGED, UNREACHABLE, INVALID, UNDERDETERMINED])
"""By their code, which solvers write; kernels the first two alone."""

CONVERGED, UNCONVERGED, OPEN, UNUSABLE, EXACT = range(len(WORDS))

EXPLANATION = {
    UNDERDETERMINED: "no posture has more than three measured angles, and the chain follows them exactly: there is "
    "nothing to adapt to. The angles of the clavicle would help: mark SC and AC, or place them with girdle convert "
    "--sc-from-ij and --aa-to-ac",
}
"""What a status that its word does not explain means, and what would help."""
