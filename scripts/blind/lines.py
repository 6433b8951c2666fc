"""What is kept of a diagnosis, and what the truth adds to it once it is opened."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from adapt.diagnosis.diagnosis import RankedDiagnosis
from adapt.diagnosis.fit.misfit import misfit
from adapt.diagnosis.fit.observations import Observed, observe
from adapt.diagnosis.inference.ranking import Ranking, rank
from adapt.diagnosis.inference.verdict import posterior_probabilities, unknown_penalties
from adapt.diagnosis.result import NONE, UNKNOWN, ChannelAmplitude, GapLevels
from models import ParameterSet
from motions import read_motions
from motions.rotations import DEG
from scripts.blind.cases import SHOWN_MOTIONS, UNSEEN_MOTION
from scripts.blind.fits import tried
from scripts.blind.runs import Line


def observed(path: Path, subjects: Sequence[str]) -> Observed:
    """A motion file as the diagnosis sees it, some subjects only."""
    data = observe(read_motions(path))
    return data.select_subjects(np.array([data.subjects.index(name) for name in subjects]))


def single_ranking(found: RankedDiagnosis, data: Observed) -> Ranking:
    """The ranking of none and single effects, as it was before pairs were tried."""
    single = [one for one in found.ranking.fitted if len(one.hypothesis) <= 1]
    if len(single) == len(found.ranking.fitted):
        return found.ranking
    return rank(single, tried(found), data, found.noise)


def line_of(found: RankedDiagnosis, single: Ranking) -> Line:
    """What is kept of a diagnosis."""
    verdict, noise = found.verdict, found.noise

    def gaps(levels: GapLevels | None) -> dict[str, Any]:
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
        "amplitude": {name: [asdict(one) for one in size.channels] for name, size in found.amplitude.items()},
        "gap_deg": gaps(found.gaps.unseen),
        "other_motion_deg": gaps(found.gaps.other_motion),
        "indistinguishable": found.indistinguishable,
        "detectable": {name: one.value if one else None for name, one in found.smallest_detectable.items()},
        "foreseen": {name: one.named for name, one in found.predicted_power.items()},
        "subjects": list(found.subjects),
        "left_out": found.left_out,
    }


def tests_of(found: RankedDiagnosis) -> dict[str, Any]:
    """What the probability of unknown follows from, pairs and all."""
    ranking = found.ranking
    names = [name for name in found.verdict.probability if name not in (NONE, UNKNOWN)]
    posterior = posterior_probabilities(ranking.hypotheses, ranking.log_evidence, names, found.declared_effects)
    return {
        "discrepancy_gain": ranking.discrepancy_gain,
        "excess": ranking.excess,
        "doubts": list(unknown_penalties(ranking, posterior)),
    }


def realised_gaps(found: RankedDiagnosis, model: ParameterSet, data: Observed) -> dict[str, float]:
    """Mean absolute gap on the unseen motion, deg, of what was fitted to the others: none, and the best hypothesis.

    The data hold a motion already seen beside the unseen one, so that nothing is compiled anew for their shape.
    """
    data = data.without(data.motion != data.motions.index(UNSEEN_MOTION))
    fitted = {one.hypothesis: one for one in found.ranking.fitted}
    known, effects = data.measured[:6] & data.counted, tried(found)

    def gap(z: np.ndarray) -> float:
        nearest = misfit(model.girdle, effects, data, found.noise.noise, z).nearest
        apart = np.where(known, np.abs(data.values - nearest)[:6] * DEG, 0.0).sum(axis=(0, 1))
        count = known.sum(axis=(0, 1))
        return float((apart / np.maximum(count, 1))[count > 0].mean())

    return {"adapted": gap(fitted[()].z), "with_effect": gap(fitted[found.best].z)}


def with_truth(found: RankedDiagnosis, truth: dict[str, Any]) -> Line:
    """What the truth adds to the line: the amplitudes behind those found, and what was lost on the way."""
    means = {name: float(np.mean(list(effect["amplitude"].values()))) for name, effect in truth["effects"].items()}
    known = {
        name: true_channels(name, truth["effects"][name], found.subjects)
        for name in sorted(found.amplitude.keys() & means)
    }
    return {
        "true_mean_amplitude": means,
        "true_channels": {
            name: _by_channel(found.amplitude[name].channels, values) for name, values in known.items() if len(values)
        },
        "open_postures": len(truth["dropped"]),
    }


def _by_channel(channels: Sequence[ChannelAmplitude], values: np.ndarray) -> dict[str, float]:
    return {one.channel: float(value) for one, value in zip(channels, values, strict=True)}


def true_channels(name: str, effect: dict[str, Any], subjects: Sequence[str]) -> np.ndarray:
    """Mean over subjects and shown motions of an effect's channels, at full elevation, in the library's units.

    Empty where the world has no such numbers: the skin artefact's direction follows from each subject's motion.
    """
    if name == "skin_artefact":
        return np.zeros(0)
    chosen = [list(effect["amplitude"]).index(subject) for subject in subjects]
    amplitude = np.array(list(effect["amplitude"].values()))[chosen, None]
    drawn = effect["parameters"]
    by_motion = drawn.get("factor_by_motion", {})
    over_motions = np.mean([by_motion.get(motion, 1.0) for motion in SHOWN_MOTIONS])
    if name == "scapulothoracic_gap":
        directions = np.column_stack([np.array(drawn["ts_fraction_by_subject"])[chosen], np.ones(len(chosen))])
    else:
        directions = (
            np.array(drawn["direction_by_subject"])[chosen] if "direction_by_subject" in drawn else np.ones((1, 1))
        )
    return (over_motions * amplitude * directions).mean(axis=0)
