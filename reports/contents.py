"""The chapters of the page, in its order. A study's own chapter is a module and a word here."""

from reports import (
    accuracy_clearance,
    accuracy_ideal,
    answer,
    cost,
    energy,
    extremes,
    method,
    predictability,
    stability,
)

CHAPTERS = (
    answer.CHAPTER,
    accuracy_ideal.CHAPTER,
    accuracy_clearance.CHAPTER,
    cost.CHAPTER,
    energy.CHAPTER,
    predictability.CHAPTER,
    stability.CHAPTER,
    extremes.CHAPTER,
    method.CHAPTER,
)
