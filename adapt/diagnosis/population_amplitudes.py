"""Population and subject-level amplitudes of causes, without the motions and persons that a fold holds out."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

import jax
import numpy as np
from jaxtyping import Float

from adapt.diagnosis.fit.candidates import Candidates, Hypothesis
from adapt.diagnosis.fit.likelihood import Likelihood
from adapt.diagnosis.fit.positions.position_evidence import shown_sizes
from adapt.diagnosis.fit.posterior import Posterior
from adapt.diagnosis.fit.search_folds import Folds
from adapt.diagnosis.inference.search import Search
from adapt.solvers.rows import PostureRows
from adapt.tables.folds import MOTION, Fold
from models.adapted_parameters import ADAPTED
from models.effects import ActiveEffects, Effect
from models.effects.amplitudes import Amplitude, active_effects
from motions.table import Motions

_N = len(ADAPTED)


def effects_of_folds(
    search: Search,
    hypothesis: Hypothesis,
    motions: Motions,
    rows: PostureRows,
    folds: Sequence[Fold],
    library: Mapping[str, Effect],
    active: Hypothesis,
    seen: Collection[str],
) -> ActiveEffects:
    """Compute the effects of a hypothesis for every fold at its postures, (channels, postures, folds).

    ``folds``: all of one kind. Effects in ``active`` but not in the hypothesis get amplitude 0. ``seen``: causes that
    positions show.
    """
    kind = search.folds.only(folds[0].kind)
    candidates = search.joint.candidates
    at = search.mode(hypothesis)
    amplitudes = held_out_amplitudes(kind, candidates, hypothesis, at, search.likelihood_without, seen)
    none = no_size(active, library)
    by_held_out = {
        (fold.held_out, fold.held_out_subjects): active_effects(
            none | {effect.name: a[own].tolist() for effect, own in candidates.slices(hypothesis)}, motions, library
        )
        for fold, a in zip(kind.each, amplitudes, strict=True)
    }
    every = (by_held_out[fold.held_out, fold.held_out_subjects] for fold in folds)
    return _side_by_side(every, rows, [fold.subject for fold in folds])


def held_out_amplitudes(
    folds: Folds,
    candidates: Candidates,
    hypothesis: Hypothesis,
    at: Posterior,
    likelihood_without: Callable[[str], Likelihood],
    seen: Collection[str] = (),
) -> Float[np.ndarray, "folds own"]:
    """Compute the amplitudes of a hypothesis for every fold, in the linear model around the mode ``at`` of a subset.

    Causes that were ``seen`` get the amplitudes that positions show.
    """
    where, here = candidates.where(hypothesis), candidates.among_all(at.hypothesis, at.amplitude)
    Z, own = at.Z[..., np.concatenate([np.arange(_N), _N + where])], np.arange(len(where))
    of_motion = {
        motion: likelihood_without(motion).evidence(at.theta_mm, at.y, Z, where, here[where])
        for motion in dict.fromkeys(fold.held_out for fold in folds.each)
    }
    subjects = np.arange(len(at.theta_mm))
    found: dict[tuple[str, tuple[int, ...]], np.ndarray] = {}
    for fold in folds.each:
        if (held_out := (fold.held_out, fold.held_out_subjects)) not in found:
            others = ~np.isin(subjects, fold.held_out_subjects)
            evidence = of_motion[fold.held_out].of(others)
            given = evidence.given(own, here[where], candidates.mean[where], candidates.scale[where])
            positions = likelihood_without(fold.held_out).positions
            shown = shown_sizes(positions and positions.of(others), candidates, hypothesis, seen)
            found[held_out] = given.amplitude
            if shown:
                found[held_out][shown.where] = shown.given.amplitude
    return np.array([found[fold.held_out, fold.held_out_subjects] for fold in folds.each])


def own_effects(
    search: Search,
    hypothesis: Hypothesis,
    motions: Motions,
    rows: PostureRows,
    folds: Sequence[Fold],
    library: Mapping[str, Effect],
    seen: Collection[str],
) -> ActiveEffects:
    """Compute the effects of a hypothesis with subject-level amplitudes, for every subject and then every fold:
    (channels, postures, subjects and folds). A fold's amplitudes are fitted without the kind of motion that it holds
    out."""
    subjects = range(len(rows.subjects))
    wanted: list[tuple[str | None, int]] = [(None, subject) for subject in subjects]
    wanted += [(fold.held_out if fold.kind == MOTION else None, fold.subject) for fold in folds]
    motions_held_out = dict.fromkeys(motion for motion, _ in wanted)
    sizes = {motion: search.sizes_of_shoulders(hypothesis, seen, motion) for motion in motions_held_out}
    every = (
        active_effects({name: a.tolist() for name, a in sizes[motion][subject].items()}, motions, library)
        for motion, subject in wanted
    )
    return _side_by_side(every, rows, [subject for _, subject in wanted])


def no_size(names: Hypothesis, library: Mapping[str, Effect]) -> dict[str, Amplitude]:
    """Give each effect the amplitude 0."""
    return {name: (0.0,) * len(library[name].directions) for name in names}


def _side_by_side(every: Iterable[ActiveEffects], rows: PostureRows, subjects: Sequence[int]) -> ActiveEffects:
    """Stack effects, each at the postures of its own subject."""

    def packed(subject: int) -> Callable[[Float[np.ndarray, "*k rows"]], Float[np.ndarray, "*k postures"]]:
        return lambda values: rows.packed(values)[..., subject]

    each = [jax.tree.map(packed(subject), effects) for effects, subject in zip(every, subjects, strict=True)]
    return jax.tree.map(lambda *values: np.stack(values, axis=-1), *each)
