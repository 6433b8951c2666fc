# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportOperatorIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""The gap on postures that an adaptation has not seen: each motion held out in turn, and every third posture."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from adapt import status
from adapt.adaptation import Adapted, Lanes, adapt_lanes, lanes_at
from adapt.batch import Batch
from adapt.chunks import lanes_of
from adapt.fit import fit_lanes
from adapt.objective import WEIGHT
from motions.rotations import DEG
from motions.table import Motions

MOTION, POSTURES, OTHER = "motion", "postures", "only"
"""Kinds of folds: one motion held out, every third posture held out, one motion alone adapted to."""

_POSTURE_FOLDS = 3

BONES = {"": slice(0, 6), "clavicle_": slice(0, 3), "scapula_": slice(3, 6)}
"""Gaps of a table, by the beginning of the column."""

_PLACES = 3
"""A posture that no fit has been to starts from a few places, as before an adaptation."""


@dataclass(frozen=True)
class Fold:
    """One subject, the postures its girdle is adapted to and those its gap is looked at."""

    subject: int
    kind: str
    held_out: str
    fitted: Bool[np.ndarray, " postures"]
    tested: Bool[np.ndarray, " postures"]


def folds(motions: Motions, batch: Batch) -> list[Fold]:
    """Every motion of every subject that has several, and every third posture of every subject."""
    found = []
    for subject, (names, counted) in enumerate(_named(motions, batch)):
        several = list(dict.fromkeys(names[counted].tolist()))
        held = [(MOTION, name, counted & (names == name)) for name in several if len(several) > 1]
        turn = np.cumsum(counted) % _POSTURE_FOLDS
        held += [(POSTURES, f"third {k + 1}", counted & (turn == k)) for k in range(_POSTURE_FOLDS)]
        found += [
            Fold(subject, kind, name, counted & ~of, of)
            for kind, name, of in held
            if of.any() and (counted & ~of).any()
        ]
    return found


def folds_between(motions: Motions, batch: Batch, fitted: str, tested: str) -> list[Fold]:
    """Adapt to one motion, look at another one, of every subject that has both."""
    found = []
    for subject, (names, counted) in enumerate(_named(motions, batch)):
        one, other = counted & (names == fitted), counted & (names == tested)
        if one.any() and other.any():
            found.append(Fold(subject, OTHER, tested, one, other))
    return found


def _named(motions: Motions, batch: Batch):
    counted = np.asarray(batch.counted)
    return [(motions.motion[batch.rows[:, s]], counted[:, s]) for s in range(len(batch.subjects))]


@dataclass(frozen=True)
class HeldOut:
    """Gaps of L = models x folds lanes, degrees; lane = model * folds + fold."""

    adapted: Adapted
    """Without the postures held out."""
    before_deg: Float[np.ndarray, "6 postures lanes"]
    """|simulated - measured| of the model as it is, at the postures tested; NaN elsewhere and where a fit failed."""
    in_sample_deg: Float[np.ndarray, "6 postures lanes"]
    """Of the girdle adapted to all postures."""
    unseen_deg: Float[np.ndarray, "6 postures lanes"]
    """Of the girdle adapted without them."""


def held_out(
    data: Lanes,
    adapted: Adapted,
    subjects: int,
    parts: Sequence[Fold],
    weight: float = WEIGHT,
    progress: Callable[[str], None] = lambda _: None,
) -> HeldOut:
    """Adapt every lane (model * subjects + subject) of ``data`` anew without the postures of each of its folds.

    ``adapted`` are the adaptations of the same lanes to everything.
    """
    models = adapted.theta_mm.shape[-1] // subjects
    lane = np.concatenate([m * subjects + np.array([part.subject for part in parts]) for m in range(models)])
    fitted, tested = (
        np.tile(np.stack([getattr(part, k) for part in parts], axis=1), models) for k in ("fitted", "tested")
    )
    progress(f"held-out gaps, {len(lane)} adaptations")
    part_of = lanes_at(data, lane, counted=fitted)
    without = adapt_lanes(part_of, weight)
    thetas = (np.asarray(part_of.girdle.adapted_mm), adapted.theta_mm[:, lane], without.theta_mm)
    good = (np.ones(len(lane), bool), adapted.status[lane] == status.OK, without.status == status.OK)
    gaps = [_gaps_deg(part_of, theta, tested & ok) for theta, ok in zip(thetas, good, strict=True)]
    return HeldOut(without, *gaps)


def _gaps_deg(data: Lanes, theta_mm, of: Bool[np.ndarray, "postures lanes"]) -> Float[np.ndarray, "6 postures lanes"]:
    posture, lane = np.nonzero(of)
    girdle = lanes_of(data.girdle.with_adapted(theta_mm), lane)
    angles, measured = (np.asarray(x)[:, posture, lane] for x in (data.angles, data.measured))
    found = fit_lanes(girdle, angles, measured, places=_PLACES)
    result = np.full((6, *of.shape), np.nan)
    result[:, posture, lane] = np.where(
        measured & (found.status == status.OK), np.abs(found.angles - angles) * DEG, np.nan
    )
    return result


def heldout_table(
    subjects: Sequence[str], models: Sequence[str], parts: Sequence[Fold], found: HeldOut
) -> pd.DataFrame:
    """``heldout.csv``: one row a model, subject and part held out; gaps are mean |simulated - measured|, degrees."""
    rows = []
    for m, model in enumerate(models):
        for k, part in enumerate(parts):
            lane = m * len(parts) + k
            row: dict[str, object] = {"model": model, "subject": subjects[part.subject]}
            row |= {"kind": part.kind, "held_out": part.held_out}
            row |= {"postures": int(part.tested.sum()), "adapted_to": int(part.fitted.sum())}
            for word in ("before", "in_sample", "unseen"):
                gap = getattr(found, f"{word}_deg")[..., lane]
                for bone, angles in BONES.items():
                    row[f"{bone}gap_{word}_deg"] = mean_of(gap[angles])
            row["status"] = found.adapted.status[lane]
            rows.append(row)
    return pd.DataFrame(rows)


def mean_of(gaps_deg: Float[np.ndarray, "..."]) -> float:
    """Mean over what there is; NaN where there is nothing."""
    known = gaps_deg[np.isfinite(gaps_deg)]
    return float(known.mean()) if known.size else float("nan")


def by_subject(table: pd.DataFrame) -> pd.DataFrame:
    """Gaps of each model, subject and kind: mean over its parts, each counting as many times as it has postures."""
    columns = [c for c in table.columns if c.endswith("_deg")]
    weighed = table[columns].mul(table["postures"], axis=0).where(table[columns].notna())
    counts = table[columns].notna().mul(table["postures"], axis=0)
    keys = [table[k] for k in ("model", "subject", "kind")]
    sums = (part.groupby(keys, sort=False).sum() for part in (weighed, counts))
    total, count = sums
    return (total / count.where(count > 0)).reset_index()
