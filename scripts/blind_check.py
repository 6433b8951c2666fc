"""The withheld-effect check: does the diagnosis name an effect that it has not been told of?

`scripts/blind_world` makes simulated subjects with a hidden effect; the diagnosis sees their motion file alone; the
truth is opened after the verdict. One line of JSON a case goes to FOLDER/cases.jsonl, and a rerun does only what is
missing there. Everything is simulated, from the same parameter set that the diagnosis is given.

    python scripts/blind_check.py --out out/blind                                       the reported study
    python scripts/blind_check.py --out out/blind --report                              its figures, once more
    python scripts/blind_check.py --out out/calibration --seeds 0:12                    cases to fit thresholds on
    python scripts/blind_check.py --out out/calibration --calibrate                     the thresholds that follow

With --keep-fits the fits of a case are kept too, and --weigh has the code as it is now weigh them anew: in seconds a
case one sees what another prior does. Nothing is fitted again, and no shrinkage realised again.

How far the gap shrinks on a motion that nobody has seen is checked on a third motion. A world's random numbers depend
on its number of motions (directions and noise do), so where it is needed the world has all three, and the diagnosis is
shown the first two.
"""

import hashlib
import json
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
import pandas as pd
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from adapt.cache import keep_compiled
from adapt.diagnosis import Amplitude, Diagnosis, diagnose
from adapt.diagnosis.heldout import Gaps
from adapt.diagnosis.misfit import misfit
from adapt.diagnosis.observed import Observed, observe
from adapt.diagnosis.ranking import Ranking, rank
from adapt.diagnosis.verdict import EFFECT, NONE, UNKNOWN, doubts, shares_of
from models import ParameterSet, load_model
from models.effects import EFFECTS
from motions import read_motions
from motions.rotations import DEG
from scripts import blind_calibration, blind_report
from scripts.blind_fits import Kept, keep, read_kept, weighed_anew
from scripts.blind_report import Line, key, kind
from scripts.blind_world import LABELS, World, make_world
from scripts.reporting import check_known

ROOT = Path(__file__).parents[1]
MODELS = ("R2", "R4", "R6", "breteler_dissection")
"""Which of them makes a world and is given to the diagnosis goes by the seed."""

CALIBRATION_SEEDS = range(100_000)
"""Of worlds that the thresholds of adapt/diagnosis/verdict.py were fitted on, and everything was tried out on."""

REPORTED_SEEDS = range(200_000, 200_012)
"""The published figures: no threshold was ever fitted on these."""

NONE_WORLDS = 8
"""Worlds without an effect a seed: all that says how often an effect is blamed on nothing."""

_NEXT_WORLD = 1_000_000
"""Between the seeds of the worlds of one seed: more than any seed."""

_MOST_REPEATS = 100
"""More than any label is repeated: worlds of different labels have subjects and noise of their own."""

SHOWN_MOTIONS = ("abduction", "forward_flexion")
UNSEEN_MOTION = "scapular_plane"

LISTED = tuple(label for label in LABELS if kind(label) == "effect")
OUTSIDE = tuple(label for label in LABELS if kind(label) == "outside")
PAIRS = (
    "conoid_strain+scapula_landmark_bias",
    "scapulothoracic_gap+clavicle_axial_estimate",
    "ac_translation+skin_artefact",
    "sc_translation+scapula_landmark_bias",
    "thorax_tilt+clavicle_axial_estimate",
    "thorax_asymmetry+skin_artefact",
    "thorax_shape+conoid_strain",
    "clavicle_length+scapulothoracic_gap",
    "scapula_size+thorax_extension",
    "scapula_landmark_bias+clavicle_axial_estimate",
    "sc_translation+skin_artefact",
    "ac_translation+thorax_extension",
)


@dataclass(frozen=True)
class Condition:
    """How the worlds of a condition are made, and what is in them."""

    labels: tuple[str, ...]
    subjects: int = 10
    noise_deg: float = 1.5
    size: float = 1.0
    mixed_sign: bool = False
    landmarks: bool = False
    left_out: bool = False
    """The effect at work is taken from the library before the diagnosis."""
    third_motion: bool = False
    """Of worlds with one listed effect."""


SINGLE = ("none", *LISTED, *OUTSIDE)
CONDITIONS = {
    "standard": Condition((*SINGLE, *PAIRS), third_motion=True),
    "loo": Condition(LISTED, left_out=True, third_motion=True),
    "half": Condition((*LISTED, *OUTSIDE), size=0.5),
    "three": Condition(SINGLE, subjects=3),
    "one": Condition(SINGLE, subjects=1),
    "mixed": Condition((*LISTED, *OUTSIDE), mixed_sign=True),
    "landmarks_three": Condition(SINGLE, subjects=3, landmarks=True),
    "noise_3": Condition(SINGLE, noise_deg=3.0),
    "power_0.25": Condition(LISTED, size=0.25),
    "power_1.5": Condition(LISTED, size=1.5),
    "power_2": Condition(LISTED, size=2.0),
}
"""`loo` has the worlds of `standard`. Without an effect, its size and sign change nothing. `power` means all three; the
power curve's other two sizes are `half` and `standard`."""


@dataclass(frozen=True)
class Case:
    """One world to diagnose."""

    condition: str
    label: str
    seed: int
    repeat: int = 0

    @property
    def model(self) -> str:
        """The parameter set of world and diagnosis."""
        return MODELS[self.seed % len(MODELS)]


AnyCase = TypeVar("AnyCase", bound=Case)
"""A case, or one with more to it."""


# What to do ---------------------------------------------------------------------------------------------------------


def plan(conditions: Sequence[str], seeds: Sequence[int], labels: Sequence[str] = ()) -> list[Case]:
    """The cases, seed by seed, so that what is done of a study is a smaller study."""
    return [
        Case(condition, label, seed, repeat)
        for seed in seeds
        for condition in conditions
        for label in CONDITIONS[condition].labels
        for repeat in range(NONE_WORLDS if label == "none" else 1)
        if label in labels or not labels
    ]


def missing(cases: Sequence[AnyCase], lines: Sequence[Line]) -> list[AnyCase]:
    """The cases that have no line yet, or that failed: a cause may have gone."""
    done = {key(line) for line in lines if "failed" not in line}
    return [case for case in cases if key(asdict(case)) not in done]


def world_of(case: Case) -> World:
    """The world of a case; the first two of three motions are what the diagnosis may see."""
    how = CONDITIONS[case.condition]
    three = how.third_motion and kind(case.label) == "effect"
    return make_world(
        case.label,
        ROOT / "models" / f"{case.model}.toml",
        subjects=how.subjects,
        noise_deg=how.noise_deg,
        size=how.size,
        seed=case.seed + _NEXT_WORLD * (case.repeat + _MOST_REPEATS * (*LABELS, *PAIRS).index(case.label)),
        motions=(*SHOWN_MOTIONS, UNSEEN_MOTION) if three else SHOWN_MOTIONS,
        mixed_sign=how.mixed_sign,
        landmarks=how.landmarks,
    )


# One case -----------------------------------------------------------------------------------------------------------


Examine = Callable[[AnyCase, Path | None], Line]


def run_case(case: AnyCase, how: Examine[AnyCase], fits: Path | None) -> Line:
    """A case to its line; what goes wrong becomes its line."""
    line = {"origin": "simulated", **asdict(case), "model": case.model, "code": code_state()}
    start = time.monotonic()
    try:
        return finite(line | how(case, fits) | {"seconds": time.monotonic() - start})
    except Exception as error:  # any failure is one case's: the others go on
        return line | {"failed": f"{type(error).__name__}: {error}"}


def examine(case: Case, fits: Path | None) -> Line:
    """The verdict on a case's world, and only then the truth; the fits are kept in the folder, if there is one."""
    world, model, how = world_of(case), load_model(case.model), CONDITIONS[case.condition]
    effects = tuple(e for e in EFFECTS.values() if not (how.left_out and e.name == case.label))
    with tempfile.TemporaryDirectory() as folder:
        shown = written(world.table, SHOWN_MOTIONS, Path(folder) / "motions.csv")
        found = diagnose(read_motions(shown), model, effects=effects)[model.name]
        data = observed(shown, found.subjects)
        recorded = line_of(found, single_ranking(found, data))
        if UNSEEN_MOTION in set(world.table["motion"]) and found.verdict.answer == EFFECT and not how.left_out:
            unseen = written(world.table, (SHOWN_MOTIONS[-1], UNSEEN_MOTION), Path(folder) / "unseen.csv")
            recorded["realised_deg"] = realised_gaps(found, model, observed(unseen, found.subjects))
    if fits:
        keep(Kept(found, data, world.truth), _kept_in(fits, case))
    return recorded | told(found, world.truth)


def weigh(case: Case, fits: Path | None) -> Line:
    """The verdict of the code as it is now on the fits of a case that were kept."""
    kept = read_kept(_kept_in(fits or Path(), case))
    found = weighed_anew(kept)
    return line_of(found, single_ranking(found, kept.data)) | told(found, kept.truth)


def _kept_in(fits: Path, case: Case) -> Path:
    return fits / f"{case.condition}_{case.label}_{case.seed}_{case.repeat}.pickle"


def written(table: pd.DataFrame, motions: Sequence[str], path: Path) -> Path:
    """The rows of some motions as a motion file."""
    table[table["motion"].isin(motions)].to_csv(path, index=False, float_format="%.4f")
    return path


def observed(path: Path, subjects: Sequence[str]) -> Observed:
    """A motion file as the diagnosis sees it, some subjects only."""
    data = observe(read_motions(path))
    return data.of_subjects(np.array([data.subjects.index(name) for name in subjects]))


def single_ranking(found: Diagnosis, data: Observed) -> Ranking:
    """The ranking of none and single effects, as it was before pairs were tried."""
    single = [one for one in found.ranking.fitted if len(one.hypothesis) <= 1]
    if len(single) == len(found.ranking.fitted):
        return found.ranking
    return rank(single, tuple(EFFECTS.values()), data, found.noise)


def line_of(found: Diagnosis, single: Ranking) -> Line:
    """What is kept of a diagnosis."""
    verdict, noise = found.verdict, found.noise

    def gaps(levels: dict[str, Gaps] | None) -> dict[str, Any]:
        return {k: asdict(levels[k]["all"]) for k in ("noise_floor", "adapted", "with_effect")} if levels else {}

    return {
        "answer": verdict.answer,
        "effects": list(verdict.effects),
        "together": verdict.together,
        "probability": verdict.probability,
        "pairs": verdict.pairs,
        "best": list(found.best),
        "ranking": {"+".join(h) or "none": v for h, v in zip(single.hypotheses, single.log_evidence, strict=True)},
        "discrepancy_gain": single.discrepancy_gain,
        "excess": single.excess,
        "tests": tests_of(found),
        "noise": {**asdict(noise.noise), "freedom": noise.freedom, "source": noise.source},
        "amplitude": {name: [asdict(one) for one in channels] for name, channels in found.amplitude.items()},
        "gap_deg": gaps(found.gap.unseen),
        "other_motion_deg": gaps(found.gap.other_motion),
        "indistinguishable": found.indistinguishable,
        "detectable": found.detectable,
        "foreseen": {name: one.named for name, one in found.foreseen.items()},
        "subjects": list(found.subjects),
        "left_out": found.left_out,
    }


def tests_of(found: Diagnosis) -> dict[str, Any]:
    """What the probability of unknown follows from, pairs and all."""
    ranking = found.ranking
    names = [name for name in found.verdict.probability if name not in (NONE, UNKNOWN)]
    shares = shares_of(ranking.hypotheses, ranking.log_evidence, names, found.expected)
    return {
        "discrepancy_gain": ranking.discrepancy_gain,
        "excess": ranking.excess,
        "doubts": list(doubts(ranking, shares)),
    }


def realised_gaps(found: Diagnosis, model: ParameterSet, data: Observed) -> dict[str, float]:
    """Mean absolute gap on the unseen motion, deg, of what was fitted to the others: none, and the best hypothesis.

    The data hold a motion already seen beside the unseen one, so that nothing is compiled anew for their shape.
    """
    data = data.without(data.motion != data.motions.index(UNSEEN_MOTION))
    fitted = {one.hypothesis: one for one in found.ranking.fitted}
    known = data.measured[:6] & data.counted

    def gap(z: np.ndarray) -> float:
        nearest = misfit(model.girdle, tuple(EFFECTS.values()), data, found.noise.noise, z).nearest
        apart = np.where(known, np.abs(data.values - nearest)[:6] * DEG, 0.0).sum(axis=(0, 1))
        count = known.sum(axis=(0, 1))
        return float((apart / np.maximum(count, 1))[count > 0].mean())

    return {"adapted": gap(fitted[()].z), "with_effect": gap(fitted[found.best].z)}


# The truth ----------------------------------------------------------------------------------------------------------


def told(found: Diagnosis, truth: dict[str, Any]) -> Line:
    """What the truth adds to the line: the amplitudes behind those found, and what was lost on the way."""
    means = {name: float(np.mean(list(of["amplitude"].values()))) for name, of in truth["effects"].items()}
    known = {
        name: true_channels(name, truth["effects"][name], found.subjects)
        for name in sorted(found.amplitude.keys() & means)
    }
    return {
        "true_mean_amplitude": means,
        "true_channels": {name: _named(found.amplitude[name], values) for name, values in known.items() if len(values)},
        "open_postures": len(truth["dropped"]),
    }


def _named(channels: Sequence[Amplitude], values: np.ndarray) -> dict[str, float]:
    return {one.channel: float(value) for one, value in zip(channels, values, strict=True)}


def true_channels(name: str, of: dict[str, Any], subjects: Sequence[str]) -> np.ndarray:
    """Mean over subjects and shown motions of an effect's channels, at full elevation, in the library's units.

    Empty where the world has no such numbers: the skin artefact's direction follows from each subject's motion.
    """
    if name == "skin_artefact":
        return np.zeros(0)
    chosen = [list(of["amplitude"]).index(subject) for subject in subjects]
    amplitude = np.array(list(of["amplitude"].values()))[chosen, None]
    drawn = of["parameters"]
    by_motion = drawn.get("factor_by_motion", {})
    over_motions = np.mean([by_motion.get(motion, 1.0) for motion in SHOWN_MOTIONS])
    if name == "scapulothoracic_gap":
        shares = np.column_stack([np.array(drawn["ts_fraction_by_subject"])[chosen], np.ones(len(chosen))])
    else:
        shares = np.array(drawn["direction_by_subject"])[chosen] if "direction_by_subject" in drawn else np.ones((1, 1))
    return (over_motions * amplitude * shares).mean(axis=0)


# Files and processes ------------------------------------------------------------------------------------------------


@cache
def code_state() -> str:
    """Eight digits that change with the code and the numbers of parameter sets: lines of two states are no study."""
    rooms = ("adapt", "models", "motions", "scripts/blind_world")
    files = sorted(path for room in rooms for end in ("py", "toml") for path in (ROOT / room).rglob(f"*.{end}"))
    return hashlib.sha256(b"\0".join(path.read_bytes() for path in files)).hexdigest()[:8]


def finite(value: Any) -> Any:
    """The same for JSON, which knows no infinity and no NaN: null instead."""
    if isinstance(value, dict):
        return {k: finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [finite(v) for v in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value


def read_lines(path: Path) -> list[Line]:
    """The lines of a study, the last of each case; what an interrupted run left of a last line is ignored."""
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    lines = [json.loads(line) for line in text.split("\n")[:-1]]
    return list({key(line): line for line in lines}.values())


def append_lines(path: Path, lines: Iterator[Line], progress: Callable[[Line], None]) -> None:
    """Write each line as a whole as soon as it is there, after what is left of an earlier run."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a+b") as file:
        file.seek(0)
        file.truncate(file.read().rfind(b"\n") + 1)
        for line in lines:
            file.write((json.dumps(line, allow_nan=False) + "\n").encode())
            file.flush()
            progress(line)


def run(cases: Sequence[AnyCase], jobs: int, how: Examine[AnyCase], fits: Path | None) -> Iterator[Line]:
    """The lines of the cases as they are done."""
    if jobs == 1:
        keep_compiled()
        yield from (run_case(case, how, fits) for case in cases)
        return
    for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(threads, "1")  # the processes started below are as many as the cores
    pool = ProcessPoolExecutor(jobs, multiprocessing.get_context("spawn"), keep_compiled)
    try:
        for done in as_completed([pool.submit(run_case, case, how, fits) for case in cases]):
            yield done.result()
    finally:
        pool.shutdown(cancel_futures=True)


def run_missing(
    path: Path, cases: Sequence[AnyCase], jobs: int, how: Examine[AnyCase], fits: Path | None = None
) -> None:
    """All cases that are not yet in the file, with a bar on stderr."""
    left = missing(cases, read_lines(path))
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task("simulated cases", total=len(cases), completed=len(cases) - len(left))

        def show(line: Line) -> None:
            bar.update(task, advance=1, description=f"{line['condition']} {line['label']}")
            if "failed" in line:
                bar.console.print(f"failed: {key(line)}: {line['failed']}", markup=False, highlight=False)

        append_lines(path, run(left, jobs, how, fits), show)


# Command line -------------------------------------------------------------------------------------------------------


def _seeds(text: str) -> range:
    first, _, end = text.partition(":")
    if not (first.isdecimal() and end.isdecimal() and int(first) < int(end) <= _NEXT_WORLD):
        raise typer.BadParameter(f"'{text}' is no range of seeds. Give the first and the one after the last, as 0:12")
    return range(int(first), int(end))


def _conditions(names: Sequence[str]) -> list[str]:
    check_known(names, [*CONDITIONS, "power"], "condition")
    chosen = [c for c in CONDITIONS if c in names or ("power" in names and c.startswith("power_"))]
    return chosen or list(CONDITIONS)


def _lines(path: Path, conditions: Sequence[str], seeds: range, labels: Sequence[str]) -> list[Line]:
    """The lines asked for."""
    found = (line for line in read_lines(path) if line["condition"] in conditions and line["seed"] in seeds)
    return [line for line in found if line["label"] in labels or not labels]


def main(
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of cases.jsonl; made if it is not there.")],
    condition: Annotated[list[str] | None, typer.Option(help="Only this condition; repeatable. Default: all.")] = None,
    seeds: Annotated[str, typer.Option(metavar="A:B", help="Seeds A to B - 1. Default: the reported ones.")] = "",
    labels: Annotated[list[str] | None, typer.Option(help="Only this label; repeatable. Default: all.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    keep_fits: Annotated[bool, typer.Option("--keep-fits", help="Keep the fits in FOLDER/fits.")] = False,
    weigh_kept: Annotated[bool, typer.Option("--weigh", help="Weigh the kept fits anew; print the figures.")] = False,
    report: Annotated[bool, typer.Option("--report", help="Run nothing; print the figures.")] = False,
    calibrate: Annotated[bool, typer.Option("--calibrate", help="Run nothing; print fitted thresholds.")] = False,
    also: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="CASES.jsonl",
            exists=True,
            dir_okay=False,
            help="With --calibrate, also fit on these lines of scripts/check_elsewhere.py; repeatable.",
        ),
    ] = None,
) -> None:
    """Diagnose simulated subjects with withheld effects; print, as Markdown, how often the diagnosis is right."""
    path, fits = out / "cases.jsonl", out / "fits"
    chosen, of_labels = _conditions(condition or []), labels or []
    if calibrate:
        within = _seeds(seeds) if seeds else CALIBRATION_SEEDS
        if within.stop > CALIBRATION_SEEDS.stop:
            raise typer.BadParameter(f"thresholds are fitted on seeds below {CALIBRATION_SEEDS.stop} alone")
        lines = _lines(path, chosen if condition else ["standard"], within, of_labels)
        others = [line for file in also or [] for line in read_lines(file)]
        print(blind_calibration.calibration([*lines, *others]))
        return
    within = _seeds(seeds) if seeds else REPORTED_SEEDS
    if not report:
        cases = plan(chosen, within, of_labels)
        if not cases:
            raise typer.BadParameter(f"no case has such a label. A label is one of {', '.join((*SINGLE, *PAIRS))}")
        how, kept_in = examine, fits if keep_fits else None
        if weigh_kept:
            path, how, kept_in = out / "weighed.jsonl", weigh, fits
            path.unlink(missing_ok=True)
            cases = [case for case in cases if _kept_in(fits, case).exists()]
        try:
            run_missing(path, cases, jobs, how, kept_in)
        except (KeyboardInterrupt, BrokenProcessPool) as error:
            why = "stopped" if isinstance(error, KeyboardInterrupt) else "a process ended, perhaps for want of memory"
            print(f"{why}; what is done is kept. Give the same command to go on.", file=sys.stderr)
            raise typer.Exit(1) from error
    print(blind_report.report(_lines(path, chosen, within, of_labels)))


if __name__ == "__main__":
    typer.run(main)
