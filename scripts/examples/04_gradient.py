"""Derivatives of an adaptation: how do errors of the measured angles change the adapted girdle of a person?

Two kinds of error of a simulated subject: a bias of one degree in scapular tipping, in every posture, and independent
noise in every angle. `adapt_subject` is a JAX function, so both effects follow from one Jacobian. The SDs are printed
beside those of `girdle trust` for noise. `girdle trust` neglects the contribution of the residuals to the curvature of
E, which matters along the flat direction of M_y and A_y.
"""

import jax
import numpy as np
from simulated_trial import shipped_subjects

from adapt import adapt_subjects
from adapt.differentiable import adapt_subject
from models import load_model

SUBJECT, MODEL = "simulated02", "breteler_dissection"

PARAMETERS = ("M_y", "M_z", "A_x", "A_y", "A_z", "conoid length")

TIPPING = 5
"""Index of scapula_x among the six angles."""

# Compilation then takes a quarter of the time, which suits a program that runs once.
QUICK_TO_COMPILE = {"xla_backend_optimization_level": 0, "xla_llvm_disable_expensive_passes": True}


def theta_mm(angles):
    """Compute the adapted parameters, mm, as a function of the measured angles (6, postures), rad."""
    model = load_model(MODEL)
    found = adapt_subject(model.girdle, model.points_mm, model.bounds_mm, angles)
    return found.theta_mm, found


def main() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Print mm per degree of tipping bias, and SDs due to noise: from the Jacobian, and from `girdle trust`."""
    motions = shipped_subjects()
    motions = motions.select(motions.subject == SUBJECT)
    slopes = jax.jit(jax.jacrev(theta_mm, has_aux=True), compiler_options=QUICK_TO_COMPILE)
    jacobian, found = slopes(np.deg2rad(motions.angles_deg.T))
    by_degree = np.deg2rad(np.asarray(jacobian))  # mm per degree, (6 parameters, 6 angles, postures)

    bias_mm = by_degree[:, TIPPING].sum(axis=1)
    trust = adapt_subjects(motions, load_model(MODEL), held_out=()).uncertainty
    noise_deg = trust.noise_deg[0]
    sd_mm = noise_deg * np.sqrt((by_degree**2).sum(axis=(1, 2)))
    trust_sd_mm = np.sqrt(np.diag(trust.noise_mm2[..., 0]))

    print(f"{SUBJECT}, {MODEL}: mean J {found.mean_j_deg2:.2f} deg^2, noise {noise_deg:.2f} deg")
    print(f"{'mm':14s} {'adapted':>8s} {'by 1 deg of tipping':>20s} {'SD by noise':>12s} {'girdle trust':>13s}")
    for row in zip(PARAMETERS, found.theta_mm, bias_mm, sd_mm, trust_sd_mm, found.free, strict=True):
        name, value, bias, sd, of_trust, free = row
        print(f"{name:14s} {value:8.1f} {bias:+20.2f} {sd:12.2f} {of_trust:13.2f}" + ("" if free else "  at its bound"))
    return bias_mm, sd_mm, trust_sd_mm


if __name__ == "__main__":
    main()
