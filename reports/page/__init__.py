"""The page: what it is made of comes from the chapters."""

from reports.page.build import FINDINGS, Report, claims_of, require_replaceable, write_report
from reports.page.moved import moved

__all__ = ["FINDINGS", "Report", "claims_of", "moved", "require_replaceable", "write_report"]
