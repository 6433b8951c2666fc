"""A gradient through a posture fit: how does the gap of each subject change with the length of the conoid?

`posture_fit` is a JAX function: `jax.grad` goes through it (by the implicit function theorem, not by its iterations),
`jax.vmap` over subjects. The subjects are simulated.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from adapt.solvers.differentiable import QUICK_TO_COMPILE, posture_fit
from simulated_trial import shipped_subjects

from models import load_model


def gap_deg2(conoid_length_mm, angles):
    """Compute the mean J over the postures (6, postures) of a subject, in rad, as a function of the conoid's length."""
    girdle = replace(load_model("R2").girdle, conoid_length_mm=conoid_length_mm)
    return jnp.mean(posture_fit(girdle, angles).j_deg2)


# Half the seconds on the first call, most of which is compilation. Leave the options out where it runs many times.
of_every_subject = jax.jit(jax.vmap(jax.value_and_grad(gap_deg2), in_axes=(None, 0)), compiler_options=QUICK_TO_COMPILE)


def angles() -> np.ndarray:
    """Arrange the measured angles by subject, (subjects, 6, postures) in rad: here all have as many postures."""
    motions = shipped_subjects()
    return np.deg2rad(motions.angles_deg).reshape(len(motions.subjects), -1, 6).transpose(0, 2, 1)


def main() -> tuple[jax.Array, jax.Array]:
    """Print gap and gradient of ten subjects."""
    gaps_deg2, slopes = of_every_subject(load_model("R2").girdle.conoid_length_mm, angles())
    for subject, gap, slope in zip(shipped_subjects().subjects, gaps_deg2, slopes, strict=True):
        print(f"{subject}: mean J {gap:6.2f} deg^2, {slope:+.3f} deg^2 for each mm of conoid")
    return gaps_deg2, slopes


if __name__ == "__main__":
    main()
