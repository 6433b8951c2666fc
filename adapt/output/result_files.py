"""Files of a result, except its record: tables, figures and the report."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from adapt.api import Adaptations, PostureFits
from adapt.diagnosis.result import Diagnoses, Diagnosis
from adapt.output.run_files import write_table
from adapt.tables.positions_table import POSITIONS_FILE, positions_table
from adapt.tables.results import Tables
from models.person.family import AnyModel
from motions import InputError, Motions
from motions.files import atomic_write

REPORT = "report.html"


def write_fits(folder: Path, result: PostureFits) -> None:
    """Write ``fits.csv`` and ``summary.csv``."""
    write_table(result.fits, folder / "fits.csv")
    write_table(result.summary, folder / "summary.csv")


def write_adaptations(folder: Path, result: Adaptations) -> None:
    """Write ``fits.csv``, ``summary.csv``, ``parameters.csv`` and ``heldout.csv``."""
    write_fits(folder, result)
    write_table(result.parameters, folder / "parameters.csv")
    write_table(result.heldout, folder / "heldout.csv")


def write_positions(folder: Path, diagnoses: Diagnoses) -> None:
    """Write ``positions.csv``: simulated and measured positions of landmarks, in every state."""
    tables = [
        positions_table(one.positions.motions, name, state, simulated, one.positions.measured_mm)
        for name, one in diagnoses.by_model.items()
        for state, simulated in one.positions.simulated_mm.items()
    ]
    write_table(pd.concat(tables, ignore_index=True), folder / POSITIONS_FILE)


def write_figures(folder: Path, diagnosis: Diagnosis) -> None:
    """Write the figures of a diagnosis, one SVG file each."""
    from adapt.output.diagnosis_figures import figures  # loading matplotlib takes half a second: not for every command

    for name, text in figures(diagnosis).items():
        atomic_write(folder / name, text)


def write_report(
    folder: Path,
    motions: Motions,
    models: Sequence[AnyModel],
    result: Tables,
    failed: Mapping[str, str],
    **shown: Any,
) -> Exception | None:
    """Write the report page, to be published with the tables; return the exception if this fails, else None.

    ``shown``: further content of the page, by the argument names of ``adapt.report.report_html``. A disk with room for
    the tables may have none for the 5 MB of the page: this must not keep the tables from being published.
    """
    from adapt.report import report_html  # loading its libraries takes 0.2 s: not for every command

    try:
        atomic_write(folder / REPORT, report_html(motions, models, result, failed, **shown))
    except Exception as error:
        return error
    return None


def raise_without_report(folder: Path, wrong: Exception | None) -> None:
    """Raise the exception of the report page, if there is one; the tables are there without the page."""
    if wrong is not None:
        if isinstance(wrong, InputError):
            raise InputError(str(folder / REPORT), None, wrong.cause, "Make room; the tables are there") from wrong
        raise wrong
