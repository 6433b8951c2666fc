"""Define an effect of your own and check that the diagnosis finds it in simulated subjects, whose truth is known.

The effect: the scapula locator exaggerates lateral rotation by a constant percentage. To have `girdle diagnose` try the
effect too, put its definition into a file in `models/effects/measurement/` as `EFFECT`; no registration is needed.
"""

import jax.numpy as jnp

from adapt import Diagnosis, diagnose, simulate_model_subjects
from models import load_model
from models.effects import EFFECTS, Effect, EffectPrior
from motions.rotations import cardan_from_rotation, rotation_from_cardan


def less_lateral_rotation(girdle, R_measured, percent):
    """Return the true posture: lateral rotation z_true = z_measured / (1 + percent / 100), other angles as measured."""
    R_clavicle, R_scapula = R_measured
    y, z, x = cardan_from_rotation(R_scapula)
    return girdle, (R_clavicle, rotation_from_cardan(jnp.stack([y, z / (1.0 + percent[0] / 100.0), x])))


EXAGGERATED = Effect(
    name="exaggerated_lateral_rotation",
    what="the locator shows more lateral rotation than there is",
    unit="%",
    directions=("of the rotation",),
    adjust=less_lateral_rotation,
    prior=EffectPrior(scale=(30.0,), sign=(1,), source="assumed, for this example"),
)


def main() -> Diagnosis:
    """Simulate five subjects with the effect, and say which of four causes explains the gap after adaptation."""
    model = load_model("R2")
    simulated = simulate_model_subjects(model, EXAGGERATED, subjects=5, noise_deg=0.5, seed=1)
    print(simulated.truth[["subject", "effect", "amplitude_1"]].round(1).to_string(index=False))

    others = [EFFECTS[name] for name in ("clavicle_frame_bias", "scapula_landmark_bias", "thorax_tilt")]
    found = diagnose(simulated.motions, model, effects=[EXAGGERATED, *others])["R2"]
    print(f"causes: {', '.join(found.verdict.names) or found.verdict.answer}")
    for name, one in found.amplitude.items():
        print(f"{name}: {one.size.value:.1f} ({one.size.low:.1f} to {one.size.high:.1f}) {one.unit}")
    for step in found.budget:
        print(f"{step.step}: held-out gap {step.gap_deg.value:.2f} deg")
    return found


if __name__ == "__main__":
    main()
