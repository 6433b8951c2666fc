"""Diagnoses with several parameter sets at once: one diagnosis keeps hardly more than one core busy."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from multiprocessing import active_children, get_context
from queue import Empty
from typing import Any

from adapt.api import Adaptations
from adapt.diagnosis import Diagnosis, diagnose
from adapt.engine.batching import cores
from adapt.output.large_runs.local_processes import ENDED_BY_THE_SYSTEM, given, processes_given
from models.person.family import AnyModel
from motions.errors import InputError
from motions.table import Motions

_SECONDS_TO_NEWS = 0.1


def diagnose_side_by_side(
    motions: Motions,
    models: Sequence[AnyModel],
    progress: Callable[[str], None],
    adaptations: Adaptations,
    **options: Any,
) -> dict[str, Diagnosis]:
    """Diagnose with every model as ``adapt.diagnosis.diagnose`` does, which takes the ``options``. Several models run
    in one process each, if there are cores for them. InputError if the system ends a process."""
    processes = min(len(models), cores())
    if processes == 1:
        return diagnose(motions, models, progress=progress, adaptations=adaptations, **options)
    stages, others = get_context("spawn").Queue(), active_children()
    try:
        with processes_given(stages, processes, cores() // processes) as pool:
            asked = [pool.submit(_diagnosed, motions, one, adaptations, options) for one in models]
            try:
                _passed_on(asked, stages, progress)
                return {name: found for one in asked for name, found in one.result().items()}
            except BaseException:  # interrupted, or one failed: do not wait for the others
                for one in active_children():
                    if one not in others:
                        one.terminate()
                raise
    except BrokenProcessPool as error:
        remedy = "Start it again with one --model at a time"
        raise InputError("the diagnosis", None, ENDED_BY_THE_SYSTEM, remedy) from error


def _passed_on(asked: Sequence[Future[Any]], stages: Any, progress: Callable[[str], None]) -> None:
    """Pass on the progress of the processes until all have ended, or one has failed."""
    while not any(one.done() and one.exception() for one in asked) and not all(one.done() for one in asked):
        with suppress(Empty):
            progress(stages.get(timeout=_SECONDS_TO_NEWS))


def _diagnosed(
    motions: Motions, model: AnyModel, adaptations: Adaptations, options: dict[str, Any]
) -> dict[str, Diagnosis]:
    return diagnose(motions, model, progress=given().put, adaptations=adaptations, **options)
