"""The chapters of the page, in its order. A study's own chapter is a module and a word here."""

from importlib import import_module

from reports.page import Chapter

NAMES = ("answer", "accuracy_ideal", "accuracy_clearance", "cost", "energy", "predictability")
CHAPTERS: tuple[Chapter, ...] = tuple(
    import_module(f"reports.chapters.{name}").CHAPTER for name in (*NAMES, "stability", "extremes", "method")
)
