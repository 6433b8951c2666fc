"""Known truths on measured shoulders: the diagnosis of real motions whose fault was put there on purpose.

AC: the motions as they are. AA: the same shoulders with the scapula in the frame of another landmark, a known constant
rotation in the bone, so scapula_landmark_bias must be in the answer and its amplitude must differ from that of AC by
just that rotation. Axial: the clavicle's measured axial rotation replaced by the estimate that turns SC and AC joint
least from their posture with the arm lowest, so clavicle_axial_estimate must be in the answer. Prints Markdown.

    python scripts/known_truth.py ../shared/motions ../shared/motions_aa --model breteler_dissection
"""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import jax.numpy as jnp
import numpy as np
import typer
from jaxtyping import Float

from adapt.cli import app as cli
from adapt.diagnosis import diagnose
from adapt.diagnosis.result import Diagnosis
from models import load_model
from motions import Motions, read_motions
from motions.rhythm import clavicle_axial_rotation
from motions.rotations import DEG, compose, rotation_from_cardan, rotation_from_vector, vector_from_rotation

BIAS = "scapula_landmark_bias"

app = typer.Typer(add_completion=False)


@app.command()
def known_truth(
    ac: Annotated[Path, typer.Argument(help="Folder of motions with the scapula in the AC frame.")],
    aa: Annotated[Path, typer.Argument(help="Folder of the same motions in the AA frame.")],
    model: cli.Models = ["breteler_dissection"],  # noqa: B006 (typer reads it, never changes it)
    noise_deg: Annotated[float, typer.Option(help="SD of one angle, the model's small faults included.")] = 3.0,
    pattern: Annotated[str, typer.Option(help="Which files of the folders.")] = "bonepin*.csv",
) -> None:
    """Diagnose the same shoulders as they are, in the AA frame, and with an estimated axial rotation."""
    as_is, in_aa = (read_motions(*sorted(folder.glob(pattern))) for folder in (ac, aa))
    truth = constant_rotation(as_is, in_aa)
    print(f"Known rotation from AC to AA frame: {_degrees(truth)}\n")
    print("| model | motions | answer | causes | share of the gap left over | amplitude of the bias, deg |")
    print("|---|---|---|---|---|---|")
    for name in model:
        bias = {}
        for what, motions in (("AC", as_is), ("AA", in_aa), ("axial estimate", with_estimated_axial(as_is))):
            found = diagnose(motions, load_model(name), noise_deg, progress=_report)[name]
            bias[what] = _bias(found)
            print(_row(what, found, bias[what]), flush=True)
        if bias["AC"] is not None and bias["AA"] is not None:
            difference = _difference(bias["AC"], bias["AA"])
            apart = np.linalg.norm(vector_from_rotation(compose(_transposed(_rotation(truth)), _rotation(difference))))
            print(
                f"\n{name}: the biases differ by {_degrees(difference)}; {apart * DEG:.1f} deg off the known rotation\n"
            )


def constant_rotation(one: Motions, other: Motions) -> Float[np.ndarray, "3"]:
    """The rotation vector (rad) of the mean R_one' R_other of the scapula, over postures that both have."""
    rows = {key: k for k, key in enumerate(zip(one.subject, one.motion, one.posture, strict=True))}
    pairs = [
        (rows[key], k)
        for k, key in enumerate(zip(other.subject, other.motion, other.posture, strict=True))
        if key in rows
    ]
    mine, others = np.array(pairs).T
    R_one, R_other = (
        np.asarray(rotation_from_cardan(jnp.asarray(m.angles_deg[k, 3:].T / DEG)))
        for m, k in ((one, mine), (other, others))
    )
    mean = np.nanmean(np.einsum("jin,jkn->ikn", R_one, R_other), axis=2)
    U, _, Vt = np.linalg.svd(mean)
    return np.asarray(vector_from_rotation(jnp.asarray(U @ Vt)))


def with_estimated_axial(motions: Motions) -> Motions:
    """The clavicle's axial rotation as two landmarks would give it, from each subject's lowest posture."""
    angles = motions.angles_deg.copy()
    for name in motions.subjects:
        mine = np.flatnonzero((motions.subject == name) & np.isfinite(motions.angles_deg).all(axis=1))
        rest = angles[mine[np.argmin(motions.humerus_elevation_deg[mine])]]
        R_clavicle, R_scapula = (rotation_from_cardan(jnp.asarray(rest[k] / DEG)) for k in (slice(3), slice(3, 6)))
        rows = jnp.asarray(motions.angles_deg[mine].T / DEG)
        count = len(mine)
        R_clavicle, R_scapula = (jnp.repeat(R[..., None], count, axis=2) for R in (R_clavicle, R_scapula))
        angles[mine, 2] = np.asarray(clavicle_axial_rotation(rows[:2], rows[3:], R_clavicle, R_scapula)) * DEG
    return replace(motions, angles_deg=angles)


def _bias(found: Diagnosis) -> Float[np.ndarray, "3"] | None:
    """Rotation vector of the bias, rad, where it is in the answer."""
    size = found.amplitude.get(BIAS)
    return None if size is None else np.array([one.value for one in size.directions.values()]) / float(DEG)


def _row(what: str, found: Diagnosis, bias) -> str:
    causes = ", ".join(" or ".join(cause.names) for cause in found.verdict.causes)
    amplitude = "" if bias is None else _degrees(bias)
    return f"| {found.model} | {what} | {found.verdict.answer} | {causes} | {found.left_over_share:.2f} | {amplitude} |"


def _difference(ac, aa) -> Float[np.ndarray, "3"]:
    """B_AC' B_AA: what the frame of AA adds to the bias of AC."""
    return vector_from_rotation(compose(_transposed(_rotation(ac)), _rotation(aa)))


def _rotation(vector):
    return rotation_from_vector(jnp.asarray(vector))


def _transposed(R):
    return jnp.swapaxes(R, 0, 1)


def _degrees(vector) -> str:
    x, y, z = np.asarray(vector) * float(DEG)
    return f"({x:.1f}, {y:.1f}, {z:.1f}), {np.linalg.norm([x, y, z]):.1f} in all"


def _report(stage: str) -> None:
    print(stage, file=sys.stderr)


if __name__ == "__main__":
    cli.main(app)
