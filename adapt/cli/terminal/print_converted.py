# pyright: reportGeneralTypeIssues=false
# (pandas says "Hashable" of a group's key)
"""Terminal output of ``girdle convert``: the motions that were written."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from adapt.cli.terminal.console import folding_table
from adapt.tables.thorax_table import THORAX_WORDS, thorax_table
from motions import Motions
from motions.landmarks.clusters.carried_columns import HUMERUS_PLACED, SCAPULA_FROM, residual_column
from motions.landmarks.mapping import CLUSTERS
from motions.landmarks.sampled_postures import CLAVICLE_Z_BY, ESTIMATE_ZERO, ESTIMATED, is_yes, marked_outliers

_NUMBER = r"\d+(\.\d+)?(e[+-]\d+)?"

MANY_FRAMES = 50
"""Largest number of postures that a palpator records; a file with more is a trial, which is better sampled."""


def print_converted(
    console: Console, motions: Motions, sources: Sequence[Path], target: Path, *, every_frame: bool
) -> None:
    """Print what was written, and what a user may not expect in it."""
    subjects = len(motions.subjects)
    console.print(
        f"{len(motions.posture)} postures of {subjects} subject{'s' if subjects > 1 else ''} in {target}",
        soft_wrap=True,
    )
    if len(sources) > 1 and subjects == len(sources):
        said = "Each file is a subject of its own; --subject, or a folder for each person, puts trials together."
        console.print(said, soft_wrap=True)
    if every_frame and sources[0].suffix.lower() in (".c3d", ".trc") and len(motions.posture) > MANY_FRAMES:
        measured = np.isfinite(motions.humerus_elevation_deg).any()
        sampled = "--at 30,60,90 would sample the trial at elevations of the arm"
        said = sampled if measured else "GH, EM and EL would give the elevation of the arm, which is empty"
        console.print(f"Every frame is a posture; {said}.", soft_wrap=True)
    _say_estimated(console, motions)
    _say_cluster(console, motions)
    _say_slipped(console, motions)
    _say_thorax(console, motions)


def _say_estimated(console: Console, motions: Motions) -> None:
    """Say that the axial rotation of the clavicle is an estimate, and at which elevation the estimate is 0."""
    if not is_yes(motions, ESTIMATED).any():
        return
    said = "clavicle_x_deg (axial rotation) is an estimate"
    if ESTIMATE_ZERO in motions.extra:
        zeros = sorted({float(word) for word in motions.extra[ESTIMATE_ZERO] if re.fullmatch(r"\d+\.?\d*", word)})
        span = " to ".join(dict.fromkeys(f"{zero:.0f}" for zero in zeros[:1] + zeros[-1:]))
        said += f"; it is 0 {f'with the arm lowest, at {span} degrees' if zeros else 'in the first posture'}"
    console.print(said, soft_wrap=True)


def _say_cluster(console: Console, motions: Motions) -> None:
    """Print which cluster gives the scapula, how GH was placed, and how well each cluster kept its shape."""
    marks = {column: list(motions.extra[column]) for column in motions.extra.columns}
    for column, what in ((SCAPULA_FROM, "The scapula is of a"), (HUMERUS_PLACED, "The elevation rests on")):
        for said in dict.fromkeys(word for word in marks.get(column, []) if word):
            console.print(f"{what} {said}", soft_wrap=True)
    for segment in CLUSTERS:
        known = [float(mm) for mm in marks.get(residual_column(segment), []) if re.fullmatch(_NUMBER, mm)]
        if known:
            said = f"residual of the rigid fit {np.median(known):.2g} mm (median), {max(known):.2g} mm (largest)"
            console.print(f"Cluster {segment}: {said}", soft_wrap=True)


def _say_slipped(console: Console, motions: Motions) -> None:
    for said in outliers_in_words(motions):
        console.print(f"{said} (column slipped)", soft_wrap=True)


def outliers_in_words(motions: Motions) -> list[str]:
    """Describe the landmark outliers, a line for each motion and set of landmarks."""
    found: dict[tuple[str, str, str], list[int]] = {}
    for row, names in marked_outliers(motions).items():
        whose = (str(motions.subject[row]), str(motions.motion[row]), names)
        found.setdefault(whose, []).append(int(motions.posture[row]))
    return [
        f"{names} slipped: not in its place on the bone in {'posture' if len(postures) == 1 else 'postures'} "
        f"{_ranges(postures)} of {subject}, {motion}"
        for (subject, motion, names), postures in found.items()
    ]


def _ranges(numbers: Sequence[int]) -> str:
    """Write 3, 5, 6, 7, 8 as '3, 5-8'."""
    parts: list[list[int]] = []
    for number in sorted(numbers):
        if parts and number == parts[-1][-1] + 1:
            parts[-1] = [parts[-1][0], number]
        else:
            parts.append([number])
    return ", ".join("-".join(map(str, part)) for part in parts)


def _say_thorax(console: Console, motions: Motions) -> None:
    """Print the angles of the thorax to the global frame (median, range) by motion, and the clavicle's z reference."""
    said_by = motions.extra.get(CLAVICLE_Z_BY)
    for said in dict.fromkeys(() if said_by is None else said_by):
        console.print(f"Clavicle's z axis by the {said}", soft_wrap=True)
    rows = thorax_table(motions)
    if not len(rows):
        return
    table = folding_table("Thorax against the global frame, degrees: median (least to most)", ("subject", "motion"))
    for name in THORAX_WORDS.values():
        table.add_column(name, no_wrap=True, justify="right")
    for (subject, motion), part in rows.groupby(["subject", "motion"], sort=False):
        cells = [
            f"{r['median_deg']:.1f} ({r['least_deg']:.1f} to {r['most_deg']:.1f})" for r in part.to_dict("records")
        ]
        table.add_row(str(subject), str(motion), *cells)
    console.print(table)
