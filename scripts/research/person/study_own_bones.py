# pyright: reportAttributeAccessIssue=false, reportArgumentType=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Does an adaptation gain from each person's own bones (`girdle adapt --own-bones`)? Prints Markdown.

    python scripts/research/person/study_own_bones.py --held-out ../shared/motions/bonepin_*.csv
    python scripts/research/person/study_own_bones.py --noise ../shared/motions/bonepin_*.csv
    python scripts/research/person/study_own_bones.py --truth
    python scripts/research/person/study_own_bones.py --intervals --persons 100 --seed 30 --seeds 3
    python scripts/research/person/study_own_bones.py --few ../shared/motions/bonepin_*.csv
    python scripts/research/person/study_own_bones.py --landmarks
    python scripts/research/person/study_own_bones.py --positions ../shared/motions_positions
    python scripts/research/person/study_own_bones.py --time ../shared/motions/bonepin_*.csv

--held-out: measured motions, each held out in turn. --noise: the same, for several assumed SDs of the noise. --truth:
simulated people with known bones. --intervals: how many intervals hold the truth, by the number of persons in a run.
--few: few postures, one motion, one person, missing angles; simulated people, and measured motions where files are
given. --landmarks: simulated people with positions of landmarks. --positions: distances to measured positions that no
fit has used. --time: compared with the plain adaptation.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from adapt import Adaptations, adapt_subjects, simulate_model_subjects
from adapt.evaluation.person_constants import Chains, distances_mm
from adapt.evaluation.position_check import Judge, adapted_to_folds, in_folds, of_motions
from adapt.own_bones.own_adaptation import HERE, WORDS, OwnBones
from adapt.own_bones.own_adaptation import People as LearntPeople
from adapt.own_bones.scales import Scales
from adapt.solvers import status
from adapt.solvers.rows import PostureRows, posture_rows
from adapt.tables.held_out import by_model
from adapt.tables.results import FAR_SDS, OWN_WORD
from models import ParameterSet, load_model, model_names
from models.adapted_parameters import ADAPTED
from models.person.own_bones import GROUPS, NAMES, NO_SDS, SHOWN_BY_LANDMARKS, SIZES, spread_about
from models.person.positions.landmark_positions import bone_poses
from motions import Motions
from motions.rhythm_subjects import DATA_FILE, NOISE_DEG
from scripts.reporting import markdown, measured, timed
from scripts.research.person.own_bone_predictions import (
    ADAPTATIONS,
    Fitted,
    adapted_to,
    bone_means,
    gaps_deg,
    without,
)
from scripts.research.person.own_bone_worlds import WORLDS, People, limit, simulate_people, with_landmarks

NORMAL_95 = 1.96


def main() -> None:
    """Print the requested parts."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--held-out", nargs="+", type=Path, metavar="MOTIONS")
    parser.add_argument("--noise", nargs="+", type=Path, metavar="MOTIONS")
    parser.add_argument("--truth", nargs="*", choices=WORLDS, metavar="WORLD", help="default: all")
    parser.add_argument("--intervals", nargs="*", choices=WORLDS, metavar="WORLD", help="default: all")
    parser.add_argument("--few", nargs="*", type=Path, metavar="MOTIONS")
    parser.add_argument("--landmarks", action="store_true")
    parser.add_argument("--positions", type=Path, metavar="FOLDER")
    parser.add_argument("--time", nargs="*", type=Path, metavar="MOTIONS")
    parser.add_argument("--model", action="append", default=[], help="parameter sets; default: all, simulated: R2")
    parser.add_argument("--persons", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=1, help="so many from --seed on, of --intervals")
    given = parser.parse_args()
    models = [load_model(name) for name in given.model or model_names()]
    one = load_model((given.model or ["R2"])[0])
    if given.held_out:
        print(held_out_table(measured(parser, given.held_out), models))
    if given.noise:
        print(noise_table(measured(parser, given.noise), models))
    if given.truth is not None:
        print_truth(one, given.truth or list(WORLDS), given.persons, given.seed)
    if given.intervals is not None:
        seeds = range(given.seed, given.seed + given.seeds)
        print(intervals_table(one, given.intervals or list(WORLDS), seeds, given.persons))
    if given.few is not None:
        people = simulate_people(one, WORLDS["as the prior"](one), given.persons, NOISE_DEG, given.seed)
        print(few_table(people.motions, one, people.true_deg))
        for model in models if given.few else []:
            print(f"\n{model.name}\n\n{few_table(measured(parser, given.few), model)}", flush=True)
    if given.landmarks:
        print(landmarks_table(simulate_people(one, WORLDS["as the prior"](one), given.persons, NOISE_DEG, given.seed)))
    if given.positions:
        print(positions_table(measured(parser, sorted(given.positions.glob("bonepin_*.csv"))), models))
    if given.time is not None:
        print_times(given.time)


def held_out_table(motions: Motions, models: Sequence[ParameterSet]) -> str:
    """Tabulate held-out gaps, means over subjects; ellipsoids; parameters at a bound."""
    header = ["set", "adaptation", "clavicle, deg", "scapula, deg", "A_y, mm", "its range", "A_z, mm", "D, rms mm"]
    header += ["at a bound", f"beyond {FAR_SDS:g} SDs: the six", "of all", "plain kept", "failed"]
    lines = []
    for model in models:
        for name, options in ADAPTATIONS.items():
            result = adapt_subjects(motions, model, **options)
            gaps, table = by_model(result.heldout).loc[model.name], result.parameters
            bounds = int(table[[f"{one}_mm_at_bound" for one in ADAPTED]].to_numpy(bool).sum())
            A_y, failed = table["A_y_mm"], (result.heldout["status"] != status.OK).sum()
            six, every = far(model, result)
            lines.append(
                [
                    *(model.name, name, *(f"{gaps[f'{bone}_gap_unseen_deg']:.3f}" for bone in ("clavicle", "scapula"))),
                    *(f"{A_y.mean():.0f}", f"{A_y.min():.0f}-{A_y.max():.0f}", f"{table['A_z_mm'].mean():.0f}"),
                    *(f"{np.sqrt(table['D_mm2'].mean()):.1f}", f"{bounds} of {6 * len(table)}"),
                    *(six, every, _kept(table), f"{failed}"),
                ]
            )
    return markdown(header, lines)


def _kept(parameters: pd.DataFrame) -> str:
    """Count the subjects whose plain adaptation was kept; "-" where no bones were adapted."""
    return f"{(parameters[OWN_WORD] != WORDS[HERE]).sum()}" if OWN_WORD in parameters else "-"


def far(model: ParameterSet, result: Adaptations) -> tuple[str, str]:
    """Count sizes farther from the set's than ``FAR_SDS``: among the six, and among all where bones were adapted."""
    own, six = result.problems.own_bones, (result.problems.adapted.theta_mm.T - model.girdle.adapted_mm).T
    six = np.abs(six) > FAR_SDS * spread_about(model).sd[: len(ADAPTED), None]
    every = "-" if own is None else f"{(np.abs(own.sizes) > FAR_SDS * own.prior_sd).sum()} of {own.sizes.size}"
    return f"{six.sum()} of {six.size}", every


NOISES_DEG = (0.4, 0.8, 1.2, 1.6, 2.4, 4.0)


def noise_table(motions: Motions, models: Sequence[ParameterSet]) -> str:
    """Tabulate held-out gaps and the largest sizes, with one noise SD for all and no learnt scale."""
    header = [
        "set",
        "noise, deg",
        "clavicle, deg",
        "scapula, deg",
        "largest size, SDs",
        f"beyond {FAR_SDS:g} SDs: the six",
    ]
    header += ["of all", "failed"]
    lines = []
    for model in models:
        for noise_deg in NOISES_DEG:
            people = LearntPeople(NO_SDS, {model.name: Scales(noise_deg=noise_deg)}, {model.name: {}})
            result = adapt_subjects(motions, model, own_bones=people)
            own, gaps = result.problems.own_bones, by_model(result.heldout).loc[model.name]
            assert own is not None
            largest = np.max(np.abs(own.sizes / own.prior_sd))
            failed = (result.heldout["status"] != status.OK).sum()
            held = (f"{gaps[f'{bone}_gap_unseen_deg']:.3f}" for bone in ("clavicle", "scapula"))
            lines.append([model.name, f"{noise_deg:g}", *held, f"{largest:.1f}", *far(model, result), f"{failed}"])
    return markdown(header, lines)


def print_truth(model: ParameterSet, worlds: Sequence[str], count: int, seed: int) -> None:
    """Print errors of the six parameters; then coverage, learnt scales, and held-out gaps."""
    errors, gaps = [], []
    for name in worlds:
        people = simulate_people(model, WORLDS[name](model), count, NOISE_DEG, seed)
        errors += error_lines(name, people)
        gaps.append(gap_line(name, people))
        print(f"{name}: {people.sizes.shape[1]} persons, {people.closing:.0%} of those drawn close", file=sys.stderr)
    print(markdown(["world", "root mean square error, mm", *ADAPTED], errors) + "\n")
    header = ["world", "in intervals: the six", "bones", "frames", "learnt scales: six, bones, frames; noise", "failed"]
    words = (f"{way}, {what}" for what in ("against the truth", "measured") for way in ("plain", "own bones"))
    print(markdown([*header, *words], gaps))


def error_lines(name: str, people: People) -> Iterator[list[str]]:
    """Format root mean square errors of the six parameters."""
    truth = people.adapted_mm

    def line(word: str, errors: Float[np.ndarray, "adapted persons"]) -> list[str]:
        return [name, word, *(f"{x:.1f}" for x in np.sqrt(np.nanmean(errors**2, axis=1)))]

    yield line("the set as it is", people.sizes[: len(ADAPTED)])
    for way in ("plain", "own bones"):
        fitted = adapted_to(people.motions, people.model, **ADAPTATIONS[way])
        yield line(way, np.asarray(fitted.girdle.adapted_mm) - truth)
    sds = people.sds[: len(ADAPTED)]
    for word, noise_deg in (("least possible", people.noise_deg), ("with 56 postures", people.noise_deg / 2.0)):
        left = limit(people, noise_deg)
        yield [name, word, *(f"{k * sd:.1f} ({k:.2f})" if sd else "-" for k, sd in zip(left, sds, strict=True))]


def gap_line(name: str, people: People) -> list[str]:
    """Format coverage, scales and gaps of one world."""
    fitted = adapted_to(people.motions, people.model, **ADAPTATIONS["own bones"])
    own, shares, failed = covered(fitted, people)
    *scales, noise = own.scales[:, 0]
    against = [held_out_gaps(people.motions, people.model, way, people.true_deg) for way in ("plain", "own bones")]
    cells = [f"{clavicle:.2f}, {scapula:.2f}" for k in (0, 1) for clavicle, scapula in (one[k] for one in against)]
    return [
        name,
        *(f"{x:.1%}" for x in shares),
        f"{', '.join(f'{one:.2f}' for one in scales)}; {noise:.2f}",
        f"{failed}",
        *cells,
    ]


def covered(fitted: Fitted, people: People) -> tuple[OwnBones, list[float], int]:
    """Return the sizes, the share of each group that is within its intervals, and the number of failed persons."""
    own, good = fitted.result.problems.own_bones, fitted.result.problems.adapted.status == status.OK
    assert own is not None
    inside = (np.abs(own.sizes - people.sizes) <= NORMAL_95 * own.sd)[:, good]
    of = np.array([size.group for size in SIZES])
    return own, [float(inside[of == group].mean()) for group in GROUPS], int((~good).sum())


def intervals_table(model: ParameterSet, worlds: Sequence[str], seeds: Sequence[int], count: int) -> str:
    """Tabulate coverage by the number of persons in a run, over the same persons; with few runs also their range."""
    header, lines = ["world", "persons in a run", "runs", "in intervals: the six", *GROUPS[1:], "failed"], []
    for name in worlds:
        everybody = [simulate_people(model, WORLDS[name](model), count, NOISE_DEG, seed) for seed in seeds]
        for size in [*(one for one in FEW_IN_A_RUN if one < count), count]:
            runs = [run for people in everybody for run in in_runs(people, size)]
            each = [covered(adapted_to(run.motions, model, **ADAPTATIONS["own bones"]), run) for run in runs]
            shares = np.array([one[1] for one in each])
            cells = [
                f"{x:.1%}" + (f" ({low:.0%}-{high:.0%})" if len(runs) <= FEW_RUNS else "")
                for x, low, high in zip(shares.mean(axis=0), shares.min(axis=0), shares.max(axis=0), strict=True)
            ]
            lines.append([name, f"{size}", f"{len(runs)}", *cells, f"{sum(one[2] for one in each)}"])
    return markdown(header, lines)


FEW_IN_A_RUN, FEW_RUNS = (1, 3, 5, 10, 20), 5


def in_runs(people: People, size: int) -> Iterator[People]:
    """Split the persons into runs of this size."""
    names = people.motions.subjects
    for first in range(0, len(names) - size + 1, size):
        some = np.isin(people.motions.subject, names[first : first + size])
        motions, sizes = people.motions.select(some), people.sizes[:, first : first + size]
        yield replace(people, motions=motions, true_deg=people.true_deg[some], sizes=sizes)


def held_out_gaps(motions: Motions, model: ParameterSet, way: str, true_deg) -> list[tuple[float, float]]:
    """Average the gaps of clavicle and scapula relative to the truth, and relative to the measured angles.

    Each kind of motion is held out of all subjects at once, also when the scales are learnt.
    """
    gaps = []
    for kind in dict.fromkeys(motions.motion.tolist()):
        seen, unseen = without(motions, kind)
        angles = predicted(motions, seen, unseen, model, ADAPTATIONS[way])
        gaps.append([gaps_deg(angles, wanted[unseen]) for wanted in (true_deg, motions.angles_deg)])
    return [bone_means(np.concatenate(each, axis=1)) for each in zip(*gaps, strict=True)]


def predicted(motions: Motions, seen: Bool[np.ndarray, " postures"], unseen, model: ParameterSet, options):
    """Adapt to the postures ``seen`` and simulate the postures ``unseen``, rad."""
    return adapted_to(motions.select(seen), model, **options).angles(motions.select(unseen))


FEW = (1, 2, 3, 5)
"""Numbers of postures of the first motion for the adaptation."""

MISSING_SHARE = 0.2


def few_table(motions: Motions, model: ParameterSet, true_deg: Float[np.ndarray, "postures 6"] | None = None) -> str:
    """Tabulate gaps of other motions after adaptation to few data, relative to the truth or, if unknown, to data.

    Adapted all persons together, and each person alone, without learnt scales. The gaps are of measured angles in
    postures that every adaptation predicts.
    """
    alone = {"own_bones": LearntPeople(NO_SDS, {model.name: Scales()}, {model.name: {}})}
    ways: dict[str, Any] = {"plain": {}, "own bones": ADAPTATIONS["own bones"], "own bones, each alone": alone}
    lines = []
    for name, changed, seen, unseen in cases(motions):
        wanted = np.where(np.isfinite(changed.angles_deg), motions.angles_deg if true_deg is None else true_deg, np.nan)
        each = [predicted(changed, seen, unseen, model, options) for options in ways.values()]
        failed = np.any(np.isnan(np.stack(each)), axis=1)
        wanted = np.where(np.any(failed, axis=0)[:, None], np.nan, wanted[unseen])
        means = (bone_means(gaps_deg(one, wanted)) for one in each)
        cells = [f"{clavicle:.2f}, {scapula:.2f}" for clavicle, scapula in means]
        lines.append([name, *cells, " ".join(f"{count}" for count in failed.sum(axis=1)) + f" of {unseen.sum()}"])
    return markdown(["measured", *(f"{way}: clavicle, scapula, deg" for way in ways), "not predicted"], lines)


def cases(motions: Motions):
    """Yield a name, the motions, and masks of the postures to adapt to and of those to predict (other motions)."""
    first = np.zeros(len(motions.subject), bool)
    for rows in motions.rows_by_subject():
        first[rows[motions.motion[rows] == motions.motion[rows[0]]]] = True
    rest = ~first & np.isin(motions.subject, motions.subject[first])
    for count in FEW:
        some = np.zeros_like(first)
        for rows in motions.rows_by_subject():
            own = rows[first[rows]]
            some[own[np.unique(np.linspace(0, len(own) - 1, count + 2)[1:-1].round().astype(int))]] = True
        yield f"{count} posture{'s' * (count > 1)}", motions, some, rest
    yield "one motion", motions, first, rest
    axial = motions.angles_deg.copy()
    axial[:, 2] = np.nan
    yield "one motion, no axial rotation", replace(motions, angles_deg=axial), first, rest
    gone = np.random.default_rng(0).random(motions.angles_deg.shape) < MISSING_SHARE
    gone[rest] = False
    holes = np.where(gone, np.nan, motions.angles_deg)
    yield "one motion, a fifth of its angles missing", replace(motions, angles_deg=holes), first, rest


LANDMARK_NOISE_MM = 3.0


def landmarks_table(people: People) -> str:
    """Tabulate SDs, errors and coverage of the sizes that landmarks determine, and held-out gaps, without and with."""
    lines, shown = [], SHOWN_BY_LANDMARKS
    for word, motions in (("angles", people.motions), ("and landmarks", with_landmarks(people, LANDMARK_NOISE_MM))):
        result = adapt_subjects(motions, people.model, **ADAPTATIONS["own bones"])
        own, gaps = result.problems.own_bones, by_model(result.heldout).loc[people.model.name]
        assert own is not None
        error = own.sizes - people.sizes
        inside = np.abs(error) <= NORMAL_95 * own.sd
        sizes = [
            f"{sd:.1f} ({rms:.1f})"
            for sd, rms in zip(own.sd.mean(axis=1), np.sqrt((error**2).mean(axis=1)), strict=True)
        ]
        held = ", ".join(f"{gaps[f'{bone}_gap_unseen_deg']:.2f}" for bone in ("clavicle", "scapula"))
        shares = f"{inside[shown].mean():.1%}", f"{inside[~shown].mean():.1%}"
        lines.append([word, *np.array(sizes)[shown].tolist(), *shares, held])
    names = np.array(NAMES)[shown].tolist()
    return markdown(["measured", *names, "in intervals", "others", "held out, deg"], lines)


def positions_table(motions: Motions, models: Sequence[ParameterSet]) -> str:
    """Tabulate root mean square distances, mm, between measured and predicted SC and AA on held-out motions.

    The constants of each person are fitted to the other motions (``adapt.evaluation.person_constants``).
    """
    rows, batch = [], posture_rows(motions)
    angles = replace(motions, landmarks_mm={})  # no fit uses the positions: they are for the comparison
    for model in models:
        found = {
            way: adapt_subjects(angles, model, **ADAPTATIONS[way]).of(model.name) for way in ("plain", "own bones")
        }
        held_out = {way: of_motions(one.held_out) for way, one in found.items()}
        folds = held_out["plain"].folds
        as_measured = in_folds(rigid(model, batch), folds)
        chains = {"measured angles": as_measured} | {w: adapted_to_folds(batch, one) for w, one in held_out.items()}
        judge = Judge.of(model, batch)
        prior = judge.prior[..., [fold.subject for fold in folds]]
        for word, one in chains.items():
            away = distances_mm(one, judge.measured_mm, prior)
            of = batch.subject[one.row]
            sc, aa = (
                [_root_mean_square(away[name][of == k]) for k in range(len(batch.subjects))] for name in ("SC", "AA")
            )
            rows.append([model.name, word, f"{np.mean(sc):.2f}", f"{np.mean(aa):.2f}", *(f"{x:.1f}" for x in aa)])
    return markdown(["set", "chain", "SC", "AA", *(f"AA {name}" for name in motions.subjects)], rows)


def rigid(model: ParameterSet, rows: PostureRows) -> Chains:
    """Place the bones at the measured angles, without closing the chain."""
    poses = bone_poses(model.girdle.repeated(len(rows.subject)), rows.angles)
    every = np.ones(len(rows.subject), bool)
    return Chains(poses, np.arange(len(rows.subject)), rows.subject, every, every)


def _root_mean_square(distances: Float[np.ndarray, " n"]) -> float:
    return float(np.sqrt(np.nanmean(distances**2)))


SUBJECTS, REPEATS, THREE_SETS = 1000, 3, ("breteler_dissection", "R2", "R4")


def print_times(files: Sequence[Path], subjects: int = SUBJECTS, repeats: int = REPEATS) -> None:
    """Print the seconds of both adaptations, run alternately, with the load of the machine."""
    print(f"load {os.getloadavg()[0]:.1f} of {os.cpu_count()} cores\n")
    print(markdown(["run", "plain, s", "own bones, s", "ratio in each pair"], time_lines(files, subjects, repeats)))


def time_lines(files: Sequence[Path], subjects: int, repeats: int) -> Iterator[list[str]]:
    """Time the adaptation of simulated subjects in Python, and whole commands with three sets."""
    model = load_model("R2")
    motions = simulate_model_subjects(model, None, subjects, NOISE_DEG, 0).motions
    few = motions.select(np.isin(motions.subject, motions.subjects[:12]))

    def run(some: Motions, way: str):
        return lambda: adapt_subjects(some, model, held_out=(), **ADAPTATIONS[way])

    for way in ("plain", "own bones"):
        run(few, way)()  # compiles the program, or reads it from the cache
    yield _pairs(f"{subjects} simulated subjects, R2", run(motions, "plain"), run(motions, "own bones"), repeats)
    for name, some in (("ten shipped subjects", [DATA_FILE]), ("measured shoulders", files)):
        if some:
            plain, own = partial(_command, some), partial(_command, some, "--own-bones")
            yield _pairs(f"{name}, three sets, `girdle adapt`", plain, own, repeats)


def _pairs(name: str, plain, own, repeats: int) -> list[str]:
    pairs = [(timed(plain), timed(own)) for _ in range(repeats)]
    seconds = [" ".join(f"{x:.1f}" for x in each) for each in zip(*pairs, strict=True)]
    return [name, *seconds, " ".join(f"{b / a:.2f}" for a, b in pairs)]


def _command(files: Sequence[Path], *more: str) -> None:
    sets = [word for name in THREE_SETS for word in ("--model", name)]
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "adapt", "adapt", *map(str, files), *sets, *more, "--out", f"{folder}/out"]
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
    if ended.returncode not in (0, 3):
        sys.exit(ended.stdout + ended.stderr)


if __name__ == "__main__":
    main()
