"""What each chapter finds, in a few sentences that it opens with."""

from collections.abc import Callable, Iterable, Mapping

from reports.results import Results

HEADLINES: Mapping[str, Callable[[Results], Iterable[str]]] = {}
