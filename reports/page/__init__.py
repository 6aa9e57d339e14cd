"""The page: what it is made of comes from the chapters."""

from reports.page.build import Report, require_replaceable, write_report
from reports.page.claims import FINDINGS, compare_claims, read_claims

__all__ = ["FINDINGS", "Report", "compare_claims", "read_claims", "require_replaceable", "write_report"]
