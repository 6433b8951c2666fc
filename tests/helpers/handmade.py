"""Results of an adaptation made by hand: quick, of any size, with known gaps and failures."""

from collections.abc import Sequence

import jax
import numpy as np
import pandas as pd
from jaxtyping import Float

from adapt import Adaptations
from adapt.evaluation.covariance import Uncertainty
from adapt.evaluation.curvature import Curvature
from adapt.evaluation.held_out import AdaptedSubjects, nothing_held_out
from adapt.solvers import status
from adapt.solvers.adaptation import Adapted
from adapt.solvers.objective import WEIGHT
from adapt.solvers.problems import problems_of
from adapt.solvers.rows import posture_rows
from adapt.solvers.solution import PostureSolution
from adapt.tables.folds import MOTION
from adapt.tables.held_out import BONE_PREFIXES, COLUMNS
from adapt.tables.results import fits_table, parameters_table, rows_of_subjects
from models.adapted_parameters import ADAPTED
from models.person.family import AnyModel, girdles_of
from motions import ANGLES, Motions
from motions.rotations import DEG

GAP_DEG = {False: 6.0, True: 2.0}
"""Simulated less measured angle, the same for every angle, before (False) and after adaptation (True)."""

HELD_OUT_DEG = 3.0
"""Simulated less measured angle on held-out motions."""

MOVED_MM = np.array([-10.0, 2.0, 1.0, 20.0, -1.0, 3.0])
"""Adapted parameters less those of the set."""


def motions_of(
    angles_deg: Float[np.ndarray, "subjects postures 6"], names: Sequence[str] = (), motion: str = "abduction"
) -> Motions:
    """Make one motion per subject; the subjects are ``names``, then s1, s2, ..."""
    subjects, postures, _ = angles_deg.shape
    every = [*names, *(f"s{k + 1}" for k in range(len(names), subjects))]
    rows = subjects * postures
    return Motions(
        subject=np.repeat(np.array(every, dtype=object), postures),
        motion=np.full(rows, motion, dtype=object),
        posture=np.tile(np.arange(1, postures + 1), subjects),
        humerus_elevation_deg=np.tile(np.linspace(0.0, 150.0, postures), subjects),
        angles_deg=angles_deg.reshape(rows, 6),
        landmarks_mm={},
        extra=pd.DataFrame(index=range(rows)),
    )


def rising(subjects: int, postures: int) -> Float[np.ndarray, "subjects postures 6"]:
    """Return typical angles of a girdle while the arm is raised; subjects are half a degree apart."""
    low = np.array([-28.0, 11.0, 7.0, 32.0, 10.0, -10.0])
    high = np.array([-55.0, 25.0, 50.0, 36.0, 50.0, 10.0])
    share = np.linspace(0.0, 1.0, postures)[None, :, None]
    return low + (high - low) * share + 0.5 * np.arange(subjects)[:, None, None]


def adaptations(
    motions: Motions,
    models: Sequence[AnyModel],
    failed: Sequence[str] = (),
    gap_deg: dict[str, float] | None = None,
) -> Adaptations:
    """Make adaptations in which every angle is off by ``GAP_DEG``.

    ``gap_deg`` replaces the gap after adaptation for the subjects that it holds. Subjects in ``failed`` did not
    converge.
    """
    lost = np.isin(motions.subject.astype(str), list(failed))
    after_deg = np.array([(gap_deg or {}).get(name, GAP_DEG[True]) for name in motions.subject.tolist()])
    by_state = {False: np.full(len(lost), GAP_DEG[False]), True: after_deg}
    fitted = {adapted: _fitted(motions, deg, lost & adapted) for adapted, deg in by_state.items()}
    tables = [fits_table(motions, one.name, state, fitted[state]) for state in by_state for one in models]
    fits = pd.concat(tables, ignore_index=True)
    results = {model.name: _adapted(motions, model, failed) for model in models}
    uncertainty = _uncertainty(len(models) * len(motions.subjects))
    parameters = parameters_table(motions.subjects, models, results, uncertainty.sd_mm, fits)
    before, by_model = ({one.name: fitted[state] for one in models} for state in by_state)
    heldout = _heldout(motions, models)
    return Adaptations(
        by_model=by_model,
        fits=fits,
        before=before,
        problems=_problems(motions, models, results),
        subjects=rows_of_subjects(fits),
        adapted=results,
        uncertainty=uncertainty,
        parameters=parameters,
        heldout=heldout,
    )


def _problems(motions: Motions, models: Sequence[AnyModel], results: dict[str, Adapted]) -> AdaptedSubjects:
    """Lay out the subjects of all models side by side, with nothing held out."""
    batch = posture_rows(motions)
    adapted: Adapted = jax.tree.map(lambda *x: np.concatenate(x, axis=-1), *results.values())
    data = problems_of(batch, models)
    return AdaptedSubjects(batch, data, adapted, nothing_held_out(data, adapted))


def _heldout(motions: Motions, models: Sequence[AnyModel]) -> pd.DataFrame:
    """Make the table of held-out motions: every motion of every subject is off by ``HELD_OUT_DEG``."""
    gaps = dict(zip(("before", "in_sample", "unseen"), (GAP_DEG[False], GAP_DEG[True], HELD_OUT_DEG), strict=True))
    rows = [
        {"model": model.name, "subject": subject, "kind": MOTION, "held_out": motion, "postures": 1, "adapted_to": 1}
        | {f"{bone}gap_{word}_deg": gap for word, gap in gaps.items() for bone in BONE_PREFIXES}
        | {"status": status.OK}
        for model in models
        for subject, motion in dict.fromkeys(zip(motions.subject.tolist(), motions.motion.tolist(), strict=True))
    ]
    return pd.DataFrame(rows, columns=COLUMNS)


def _fitted(motions: Motions, gap_deg: Float[np.ndarray, " rows"], lost: np.ndarray) -> PostureSolution:
    rows = len(lost)
    angles_deg = np.nan_to_num(motions.angles_deg) + gap_deg[:, None]
    return PostureSolution(
        angles=np.where(lost[:, None], np.nan, angles_deg).T / float(DEG),
        multipliers=np.zeros((3, rows)),
        residual_mm=np.zeros((3, rows)),
        stationarity=np.zeros(rows),
        j_deg2=gap_deg**2,
        iterations=np.ones(rows, dtype=int),
        code=np.where(lost, status.UNCONVERGED, status.CONVERGED),
        jump=np.zeros(rows, dtype=bool),
    )


def _uncertainty(problems: int) -> Uncertainty:
    """Return an uncertainty of 1 mm for every parameter, all of it from noise."""
    unit = np.repeat(np.eye(len(ADAPTED))[..., None], problems, axis=-1)
    curvature = Curvature(unit, unit, np.zeros((len(ADAPTED), 6, 1, problems)), unit, unit)
    row = np.ones((len(ADAPTED), problems))
    return Uncertainty(unit, 0.0 * unit, 0.0 * unit, unit, 0.5 * row, row[0], curvature, row > 0.0)


def _adapted(motions: Motions, model: AnyModel, failed: Sequence[str]) -> Adapted:
    names = motions.subjects
    lost = np.isin(names, list(failed))
    theta_mm = np.asarray(girdles_of(model, names).adapted_mm) + MOVED_MM[:, None]
    return Adapted(
        theta_mm=np.where(lost, np.nan, theta_mm),
        at_bound=np.zeros((len(ANGLES), len(names)), dtype=bool),
        angles=np.zeros((6, 1, len(names))),
        multipliers=np.zeros((3, 1, len(names))),
        residual_mm=np.zeros((3, 1, len(names))),
        stationarity=np.zeros((1, len(names))),
        D_mm2=np.ones(len(names)),
        L_mm2=np.full(len(names), np.nan),
        mean_j_deg2=np.ones(len(names)),
        E=np.ones(len(names)),
        weight=np.full(len(names), WEIGHT),
        point_weights=np.ones((1, len(names))),
        landmark_weight=np.zeros(len(names)),
        iterations=np.ones(len(names), dtype=int),
        sizes=np.zeros((0, len(names))),
        code=np.where(lost, status.UNCONVERGED, status.CONVERGED),
    )
