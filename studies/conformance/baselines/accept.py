"""Measures baselines: here, and as processors of other kinds would, which tells how wide bands have to be."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from contextlib import contextmanager

from studies.conformance.baselines.bands import band, moved
from studies.conformance.baselines.measured import Key, Number, measured
from studies.conformance.baselines.subjects import Subject
from studies.conformance.baselines.table import Baseline
from studies.conformance.baselines.verdicts import verdict
from studies.running.processes import Processes

#: Processors of other kinds, as variables that libraries read when they are loaded: LLVM's machine code and
#: OpenBLAS's kernels for others, NumPy's and the C library's functions without their widest instructions.
PROCESSORS: tuple[Mapping[str, str], ...] = (
    {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "OPENBLAS_CORETYPE": "Nehalem"},
    {
        "NUMBA_CPU_NAME": "haswell",
        "OPENBLAS_CORETYPE": "Haswell",
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2",
        "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR",  # as NumPy 2.4 names them
    },
)
Numbers = dict[Key, Number]


def measure_all(
    subjects: Sequence[Subject], jobs: int, done: Callable[[], None], processor: Mapping[str, str]
) -> Numbers:
    """Return the numbers of all subjects, measured in so many processes; ``done`` is told of each.

    ``processor`` is one of ``PROCESSORS``, or empty for the one that is here.

    Raises:
        NotMeasured: a run came to no end.
    """
    out: Numbers = {}
    with _environment(processor), Processes(jobs) as processes:
        futures = [processes.submit(measured, subject) for subject in subjects]
        try:
            for future in as_completed(futures):
                out |= future.result()
                done()
        except BaseException:
            processes.shutdown(cancel_futures=True)
            raise
    return out


def accepted(
    numbers: Numbers,
    baselines: Mapping[Key, Baseline],
    subjects: Sequence[Subject],
    why: str,
    measure: Callable[[Sequence[Subject], Mapping[str, str]], Numbers],
) -> dict[Key, Baseline]:
    """Return the baselines with those renewed that the numbers contradict; all others stay as they are.

    ``measure`` measures subjects as one of ``PROCESSORS`` would.
    """
    new = {key for key in numbers if key not in baselines or verdict(key, numbers[key], baselines[key])}
    concerned = [subject for subject in subjects if any(key[:3] == subject.key for key in new)]
    others = [measure(concerned, processor) for processor in PROCESSORS] if concerned else []
    kept = {key: baseline for key, baseline in baselines.items() if key in numbers}
    return kept | {key: _baseline(key, numbers[key], others, why) for key in new}


def _baseline(key: Key, number: Number, on_others: Sequence[Numbers], why: str) -> Baseline:
    others = [found[key].value for found in on_others if key in found]
    keeps = band(key.quantity, number, others)
    apart = moved(number.value, others)
    return Baseline(number.value, keeps.low, keeps.high, number.unit, apart, number.truth, why)


@contextmanager
def _environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Have the variables set in the processes that the block begins."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
