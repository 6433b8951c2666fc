"""Runs of ``girdle compare`` and ``girdle questions``."""

from pathlib import Path

from adapt.cli.ending import finish
from adapt.cli.inputs import read_inputs
from adapt.cli.options import console, errors
from adapt.cli.terminal.console import progress
from adapt.cli.terminal.print_thesis import print_answers, print_comparison
from adapt.output.large_runs.chunked_run import not_adapted
from adapt.output.run_files import results_folder, transaction, write_run, write_table
from adapt.trust.questions.answers import answered, answers_table
from adapt.trust.thesis.comparison import MotionNames, comparison, lacking


def compare_with_thesis(
    motions: list[Path], out: Path, models: list[str], mean: list[str], abduction: str, flexion: str, angles: str
) -> None:
    """Make the tables of the thesis, write the files of ``girdle compare`` and print them beside the printed tables."""
    table, sets, record = read_inputs(motions, models, angles)
    names = MotionNames.of(table, abduction, flexion)
    with results_folder(out) as folder:
        with progress(errors) as report:
            found = comparison(table, sets, names, mean, report)
        with transaction(folder) as staged:
            write_table(found.table, staged / "comparison.csv")
            options = {"mean": mean, "abduction": abduction, "flexion": flexion, "angles": angles}
            write_run(staged, "compare", record, options, table.rejected)
    print_comparison(console, found.table)
    failed = {} if found.adaptations is None else not_adapted(found.adaptations)
    finish(table, lacking(table, names, mean) | failed)


def answer_questions(motions: list[Path], out: Path, models: list[str], mean: list[str]) -> None:
    """Answer the questions of chapter 7, write the files of ``girdle questions`` and print the answers."""
    table, sets, record = read_inputs(motions, models)
    with results_folder(out) as folder:
        with progress(errors) as report:
            found = answered(table, sets, mean, report)
        with transaction(folder) as staged:
            write_table(answers_table(found), staged / "questions.csv")
            write_run(staged, "questions", record, {"mean": mean}, table.rejected)
    print_answers(console, found)
    finish(table, found.left_out)
