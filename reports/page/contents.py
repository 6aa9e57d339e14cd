"""The chapters of the page, in its order. A study's own chapter is a module and a word here."""

from reports.chapters.accuracy_clearance import CHAPTER as ACCURACY_CLEARANCE
from reports.chapters.accuracy_ideal import CHAPTER as ACCURACY_IDEAL
from reports.chapters.cost import CHAPTER as COST
from reports.chapters.energy import CHAPTER as ENERGY
from reports.chapters.limits import CHAPTER as LIMITS
from reports.chapters.method import CHAPTER as METHOD
from reports.chapters.predictability import CHAPTER as PREDICTABILITY

CHAPTERS = (ACCURACY_IDEAL, ACCURACY_CLEARANCE, COST, ENERGY, PREDICTABILITY, LIMITS, METHOD)
