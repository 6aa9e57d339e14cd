"""The page: what it is made of comes from the chapters, and it is there whole or not at all."""

from reports.page.build import claims_of, write_report
from reports.page.moved import moved

__all__ = ["claims_of", "moved", "write_report"]
