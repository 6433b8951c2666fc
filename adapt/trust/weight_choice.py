# pyright: reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# (pandas says "Series | DataFrame | scalar" of nearly every result)
"""Choice of w in E = D + w mean(J) by held-out motions, and the trade-off of D against mean J."""

from collections.abc import Callable, Sequence

import numpy as np
import pandas as pd

from adapt.evaluation.held_out import held_out, heldout_table
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted, adapt_batch
from adapt.solvers.problems import Problems
from adapt.solvers.rows import PostureRows
from adapt.tables.folds import MOTION, Fold
from adapt.tables.held_out import by_subject
from motions.rotations import DEG

WEIGHTS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)
"""Values of w in steps of half a decade about the thesis's 10; per step the gap changes by some hundredths of a
degree."""


def weight_table(
    data: Problems,
    rows: PostureRows,
    models: Sequence[str],
    folds: Sequence[Fold],
    weights: Sequence[float] = WEIGHTS,
    progress: Callable[[str], None] = lambda _: None,
) -> pd.DataFrame:
    """Tabulate ``weights.csv``: one row per model and weight, with means over subjects.

    ``thorax_points_rms_mm`` = sqrt(mean D) and ``j_rms_deg`` = sqrt(mean J) of the adaptation to all postures form the
    trade-off curve; ``gap_unseen_deg`` is the gap on held-out motions, and ``best`` is 1 where this gap is smallest.
    Subjects with a single motion are not part of the choice.
    """
    chosen, subjects = [fold for fold in folds if fold.kind == MOTION], len(rows.subjects)
    lines = []
    for weight in weights:
        progress(f"w = {weight:g}")
        adapted = adapt_batch(data, weight)
        gaps = _gaps(data, adapted, rows, models, chosen, weight)
        for m, model in enumerate(models):
            mine = slice(m * subjects, (m + 1) * subjects)
            good = adapted.status[mine] == status.OK
            D, J = (x[mine][good] for x in (adapted.D_mm2, adapted.mean_j_deg2))
            row: dict[str, object] = {"model": model, "weight": weight, "subjects_ok": int(good.sum())}
            row |= {"thorax_points_rms_mm": float(np.sqrt(D.mean())), "j_rms_deg": float(np.sqrt(J.mean()))}
            row["at_bound"] = int(adapted.at_bound[:, mine][:, good].any(axis=0).sum())
            lines.append(row | gaps.get(model, {"gap_in_sample_deg": np.nan, "gap_unseen_deg": np.nan}))
    table = pd.DataFrame(lines).sort_values("model", kind="stable", key=lambda x: x.map(list(models).index))
    least = table.groupby("model")["gap_unseen_deg"].transform("min")
    table["best"] = (table["gap_unseen_deg"] == least).astype(int)
    return table.reset_index(drop=True)


def _gaps(data, adapted: Adapted, rows: PostureRows, models, folds, weight) -> dict[str, dict[str, float]]:
    if not folds:
        return {}
    found = held_out(data, rows, folds, weight)
    good = np.asarray(data.measured) & (adapted.status == status.OK)
    in_sample = np.where(good, np.abs(adapted.angles - np.asarray(data.angles)) * DEG, np.nan)
    of_rows = [rows.unpacked(part) for part in np.split(in_sample, len(models), axis=-1)]
    gaps = by_subject(heldout_table(rows.subjects, models, found, {"in_sample": of_rows}))
    words = ["gap_in_sample_deg", "gap_unseen_deg"]
    return gaps.groupby("model")[words].mean().to_dict("index")
