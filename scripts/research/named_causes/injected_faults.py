"""Known truths on measured shoulders: the diagnosis of real motions with faults added on purpose.

Three faults, in all eight combinations: `scapula_landmark_bias`, the scapula in the frame of landmark AA instead of AC
(the same motions, published in both frames); `clavicle_axial_estimate`, the clavicle's measured axial rotation replaced
by the estimate from two landmarks; `skin_artefact`, the scapula held back on each shoulder's own course by the lag that
was measured between pins and skin, or with `--cluster` off this course, as a cluster on the acromion lags. Each
combination is diagnosed with every parameter set, with all persons and with each person left out. Two counts: how often
an added fault is named, and how often a fault is named that was not added and is not named without any fault.

The measured AC frame was rebuilt from AA by one mean rotation, and the model fits the AA frame better: the first fault
removes a bias that is already there. Therefore its size is compared too: with a movement of the AC joint as a second
effect, how much does the fitted bias differ between the two frames, and how much do the frames themselves differ?

    python scripts/research/named_causes/injected_faults.py ../shared/motions ../shared/motions_aa \
        --model breteler_dissection
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import typer
from jaxtyping import Bool, Float
from scipy.spatial.transform import Rotation

from adapt.cli import app as cli
from adapt.diagnosis import diagnose
from adapt.diagnosis.fit.posterior import modes
from adapt.diagnosis.fit.shoulders import usable
from adapt.diagnosis.inference.search import search_of
from models import ParameterSet, load_model
from models.effects import EFFECTS
from motions import Motions, read_motions
from motions.table import person_of
from scripts.reporting import CADAVER_SETS, markdown

BESIDE = "ac_translation:posture"
"""Effect that is named on these shoulders with every parameter set, or that stands for those that act like it."""

FAULTS = BIAS, AXIAL, SKIN = "scapula_landmark_bias", "clavicle_axial_estimate", "skin_artefact"

LAG_ABDUCTION_DEG = ((0, 20, 40, 60, 80, 100), (0, 2.8, 5.3, 7.9, 10.7, 13.8))
LAG_FLEXION_DEG = ((0, 20, 40, 60, 80, 100, 120, 140), (0, 6, 10, 12, 14, 16, 17, 20))
"""Elevation of the arm and lag of the skin: Cereatti et al. 2017, doi 10.1016/j.jbiomech.2017.02.004, one man."""

CLUSTER_LAG_DEG = (-7.2, 0.0, 6.0)
CLUSTER_LAG_AT_DEG = 120.0
"""Largest lag of a cluster on the acromion, about the axes of the scapula, and the arm elevation where it is reached.

Compared with a scapula locator, a cluster shows at worst this much too much backward tipping and too little lateral
rotation (Warner et al. 2012, doi 10.1016/j.humov.2011.07.004)."""

app = typer.Typer(add_completion=False)


@app.command()
def injected_faults(
    ac: Annotated[Path, typer.Argument(help="Folder of motions with the scapula in the AC frame.")],
    aa: Annotated[Path, typer.Argument(help="Folder of the same motions in the AA frame.")],
    model: Annotated[list[str], typer.Option(help="Parameter sets.")] = list(CADAVER_SETS),  # noqa: B006
    leave_out: Annotated[bool, typer.Option(help="Diagnose without each person too.")] = False,
    cluster: Annotated[bool, typer.Option("--cluster", help="Lag as a cluster on the acromion does.")] = False,
    pattern: Annotated[str, typer.Option(help="Which files of the folders.")] = "bonepin*.csv",
) -> None:
    """Diagnose the shoulders with every combination of faults; print a table and the counts."""
    as_is, in_aa = (read_motions(*sorted(folder.glob(pattern))) for folder in (ac, aa))
    known = (_scapula(as_is.angles_deg).inv() * _scapula(in_aa.angles_deg[_places(as_is, in_aa)])).mean()
    print(f"From the AC to the AA frame: {_degrees(known)}\n")
    for name in model:
        of_ac, of_aa = (fitted_bias(motions, load_model(name)) for motions in (as_is, in_aa))
        found = of_ac.inv() * of_aa
        off = np.degrees((known.inv() * found).magnitude())
        print(f"- {name}: bias {_degrees(of_ac)}; AA {_degrees(of_aa)}; between {_degrees(found)}, {off:.1f} off")
    print()
    lag = with_cluster_lag if cluster else with_skin_lag
    answers: list[Answer] = []
    kept: list[bool] = []
    print("| parameter set | persons | added | named |\n|---|---|---|---|")
    for name, (who, chosen) in itertools.product(model, _persons(as_is, leave_out)):
        without: tuple[tuple[str, ...], ...] = ()
        for added in _combinations():
            motions = with_faults(as_is.select(chosen), in_aa.select(chosen), added, lag)
            verdict = diagnose(motions, load_model(name))[name].verdict
            named = tuple(cause.names for cause in verdict.causes)
            said = ", ".join(" or ".join(names) for names in named) or verdict.answer
            print(f"| {name} | {who} | {', '.join(added)} | {said} |", flush=True)
            if added:
                answers += judged(added, named, without)
                kept += [names[0] in itertools.chain(*named) for names in without]
            else:
                without = named
    print(f"\n{counted(answers)}")
    print(f"\nfirst names without faults that stand among the names with them: {sum(kept)} of {len(kept)}")


class Answer(NamedTuple):
    """Answer of a diagnosis about one fault."""

    fault: str
    added: bool
    named: bool
    first: bool
    """True where the fault is the first name of a cause."""


def judged(added: Sequence[str], named: Sequence[Sequence[str]], without: Sequence[Sequence[str]]) -> Iterator[Answer]:
    """Judge a diagnosis of motions with faults.

    A fault that was not added is judged only where it is not among the names ``without`` any fault.
    """
    for fault in FAULTS:
        if fault in added or fault not in itertools.chain(*without):
            first = fault in (names[0] for names in named)
            yield Answer(fault, fault in added, fault in itertools.chain(*named), first)


def counted(answers: Sequence[Answer]) -> str:
    """Tabulate how often each fault is named, and named first, where it was added and where it was not."""

    def row(name: str, faults: Sequence[str]) -> list[str]:
        cells = [name]
        for added in (True, False):
            of_these = [one for one in answers if one.fault in faults and one.added == added]
            cells += [
                f"{sum(one.named for one in of_these)} of {len(of_these)}",
                str(sum(one.first for one in of_these)),
            ]
        return cells

    rows = [*(row(fault, [fault]) for fault in FAULTS), row("all", FAULTS)]
    return markdown(["fault", "added: named", "first", "not added: named", "first"], rows)


def _combinations() -> Iterator[tuple[str, ...]]:
    for count in range(4):
        yield from itertools.combinations(FAULTS, count)


def _persons(motions: Motions, leave_out: bool) -> Iterator[tuple[str, Bool[np.ndarray, " postures"]]]:
    """Yield a mask of all postures, and masks without each person."""
    yield "all", np.ones(len(motions.subject), bool)
    person = np.array([person_of(name) for name in motions.subject.tolist()])
    for one in np.unique(person) if leave_out else ():
        yield f"without {one}", person != one


def with_faults(ac: Motions, aa: Motions, added: tuple[str, ...], lag: Callable[[Motions], Motions]) -> Motions:
    """Add faults: the lag to the bone, then the frame to its angles, then the axial estimate from the result."""
    bone = lag(ac) if SKIN in added else ac
    if BIAS in added:
        bone = replace(bone, angles_deg=_in_other_frame(bone, ac, aa))
    return with_estimated_axial(bone) if AXIAL in added else bone


def fitted_bias(motions: Motions, model: ParameterSet) -> Rotation:
    """Fit the landmark bias and a movement of the AC joint together to all shoulders."""
    shoulders, _ = usable(motions)
    effects = tuple(effect for name, effect in EFFECTS.items() if name in (BIAS, BESIDE))
    search = search_of(model, shoulders, effects)
    joint = search.joint
    names = tuple(effect.name for effect in effects)
    nothing = np.zeros(sum(effect.amplitudes for effect in effects))
    (found,) = modes(joint, search.likelihood, [names], [joint.from_starts().theta_mm], [nothing])
    return Rotation.from_rotvec(found.amplitude[joint.candidates.places[BIAS]], degrees=True)


def _places(ac: Motions, aa: Motions) -> list[int]:
    """Return the rows of the same postures in the other frame."""
    rows = {key: k for k, key in enumerate(zip(aa.subject, aa.motion, aa.posture, strict=True))}
    return [rows[key] for key in zip(ac.subject, ac.motion, ac.posture, strict=True)]


def _in_other_frame(bone: Motions, ac: Motions, aa: Motions) -> Float[np.ndarray, "postures 6"]:
    """Turn the scapula by each posture's own rotation from the AC to the AA frame; return the angles."""
    place = _places(ac, aa)
    angles = bone.angles_deg.copy()
    angles[:, 3:] = _cardan(_scapula(angles) * (_scapula(ac.angles_deg).inv() * _scapula(aa.angles_deg[place])))
    return angles


def with_skin_lag(motions: Motions) -> Motions:
    """Hold the scapula back on its course from the posture with the lowest arm, by the lag at the arm's elevation."""
    angles = motions.angles_deg.copy()
    for name in motions.subjects:
        mine = np.flatnonzero((motions.subject == name) & np.isfinite(motions.angles_deg).all(axis=1))
        elevation = motions.humerus_elevation_deg[mine]
        sideways = np.array(["abduction" in motion or "frontal" in motion for motion in motions.motion[mine]])
        lag = np.where(sideways, np.interp(elevation, *LAG_ABDUCTION_DEG), np.interp(elevation, *LAG_FLEXION_DEG))
        bone = _scapula(motions.angles_deg[mine])
        rest = bone[int(np.argmin(elevation))]
        way = (rest.inv() * bone[elevation >= 0.8 * elevation.max()]).mean().as_rotvec()
        behind = Rotation.from_rotvec(-np.radians(lag)[:, None] * way / np.linalg.norm(way))
        angles[mine, 3:] = _cardan(bone * behind)
    return replace(motions, angles_deg=angles)


def with_cluster_lag(motions: Motions) -> Motions:
    """Hold the scapula back in one direction of its own frame, increasingly until the arm is up."""
    angles, known = motions.angles_deg.copy(), np.isfinite(motions.angles_deg).all(axis=1)
    grown = np.clip(np.nan_to_num(motions.humerus_elevation_deg[known]) / CLUSTER_LAG_AT_DEG, 0.0, 1.0)
    behind = Rotation.from_rotvec(-np.outer(grown, CLUSTER_LAG_DEG), degrees=True)
    angles[known, 3:] = _cardan(_scapula(angles[known]) * behind)
    return replace(motions, angles_deg=angles)


def with_estimated_axial(motions: Motions) -> Motions:
    """Replace the clavicle's axial rotation by its estimate from two landmarks.

    The estimate minimises the rotations of the SC and the AC joint from the posture with the lowest arm (van der Helm
    and Pronk 1995; thesis, 6.3).
    """
    angles = motions.angles_deg.copy()
    for name in motions.subjects:
        mine = np.flatnonzero((motions.subject == name) & np.isfinite(motions.angles_deg).all(axis=1))
        rest = int(np.argmin(motions.humerus_elevation_deg[mine]))
        clavicle, scapula = _clavicle(motions.angles_deg[mine]), _scapula(motions.angles_deg[mine])
        without = Rotation.from_euler("YZX", motions.angles_deg[mine, :3] * [1, 1, 0], degrees=True)
        joint = (clavicle[rest].inv() * scapula[rest]).as_matrix()
        # the sum of the traces of both joints' rotations is tr(Rx(c) B)
        B = (clavicle[rest].inv() * without).as_matrix() + joint @ (scapula.inv() * without).as_matrix()
        angles[mine, 2] = np.degrees(np.arctan2(B[:, 1, 2] - B[:, 2, 1], B[:, 1, 1] + B[:, 2, 2]))
    return replace(motions, angles_deg=angles)


def _clavicle(angles_deg: Float[np.ndarray, "postures 6"]) -> Rotation:
    return Rotation.from_euler("YZX", angles_deg[:, :3], degrees=True)


def _scapula(angles_deg: Float[np.ndarray, "postures 6"]) -> Rotation:
    return Rotation.from_euler("YZX", angles_deg[:, 3:], degrees=True)


def _degrees(rotation: Rotation) -> str:
    x, y, z = rotation.as_rotvec(degrees=True)
    return f"({x:.1f}, {y:.1f}, {z:.1f}) deg"


def _cardan(rotation: Rotation) -> Float[np.ndarray, "postures 3"]:
    return rotation.as_euler("YZX", degrees=True)


if __name__ == "__main__":
    cli.main(app)
