"""Status of a fit: one word, the same in every table and result."""

import numpy as np

OK = "ok"
UNREACHABLE = "unreachable"
"""The chain cannot be closed near this posture; the constraint violation says how far it is open."""
NOT_CONVERGED = "not_converged"
"""The solver stopped before it met its tolerances; the result is not an optimum."""
INVALID = "invalid"
"""The input does not determine a result."""
UNDERDETERMINED = "underdetermined"
"""No posture has more than three measured angles, and the chain follows them exactly: nothing is left to adapt."""

WORDS = np.array([OK, NOT_CONVERGED, UNREACHABLE, INVALID, UNDERDETERMINED])
"""Words by code. Solvers write the code; kernels write only the first two."""

CONVERGED, UNCONVERGED, OPEN, UNUSABLE, EXACT = range(len(WORDS))

EXPLANATION = {
    UNDERDETERMINED: "no posture has more than three measured angles, and the chain follows them exactly: there is "
    "nothing to adapt to. The angles of the clavicle would help: mark SC and AC, or place them with girdle convert "
    "--sc-from-ij and --aa-to-ac",
}
"""Explanation and remedy of each status that its word does not explain."""
