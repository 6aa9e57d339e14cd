"""The page: what it is made of comes from the chapters, and it is there whole or not at all."""

from reports.page.build import write_report

__all__ = ["write_report"]
