"""Runs one case, and makes a row of whatever becomes of it."""

from concurrent.futures import Future
from importlib import import_module
from typing import cast

from engine_models.engine import ProcessTaken, SimulationFailed, UnsupportedScene
from engine_models.scene.plain_words import one_of, shown
from studies.running.case import Case, Curves, Row, Study
from studies.running.execution import OUT_OF_MEMORY, ROOMY, CaseEnded, RunBroken
from studies.running.failures import bug
from studies.running.registry import STUDIES, study_module


def load_study(name: str) -> Study:
    """Return a study by its name, or by the import path of its module.

    Raises:
        ValueError: there is none.
    """
    module = study_module(name)
    try:
        return cast(Study, import_module(module))
    except ModuleNotFoundError as error:
        if error.name != module.split(".")[0] and error.name != module:
            raise  # what the study imports is missing
        known = one_of(list(STUDIES))
        raise ValueError(f"study: expected {known}, or a module's path, got {shown(name)}") from None


def run_case(case: Case) -> tuple[Row, Curves]:
    """Run one case; where there is no run the row has what ``ended`` gives.

    Raises:
        ProcessTaken: another process could run it.
        RunBroken: there is a bug in the study or an engine's model.
    """
    try:
        measured, curves = load_study(case.study).measure(case)
    except ProcessTaken:
        raise  # no answer yet: executors try it in another process
    except UnsupportedScene as refusal:
        return {**case.head(), **ended("unsupported", refusal)}, {}
    except SimulationFailed as failure:
        return {**case.head(), **ended("failed", failure)}, {}
    except MemoryError as error:
        limit = (case.limits or ROOMY).memory_limit_bytes
        reason = MemoryError(f"{error or 'no memory left'} (limit {limit} bytes)")
        return {**case.head(), **ended(OUT_OF_MEMORY, reason)}, {}
    except Exception as error:
        raise RunBroken(f"{case.arm.label} on {case.scene.name}: {bug(error)}") from error
    return {**case.head(), "status": "ok", "reason": "", **measured}, curves


def ended(status: str, failure: Exception) -> Row:
    """Return the columns of a run that is none: how it ended, the reason, and the exception's class.

    The class says who failed (see ``engine_models.engine``).
    """
    return {"status": status, "reason": str(failure), "exception": type(failure).__name__}


def outcome(case: Case, future: "Future[tuple[Row, Curves]]") -> tuple[Row, Curves]:
    """Return the row of a case that is done, however it ended."""
    try:
        return future.result()
    except CaseEnded as end:
        return {**case.head(), **ended(end.status, end)}, {}
    except ProcessTaken as refusal:
        return {**case.head(), **ended("unsupported", refusal)}, {}
