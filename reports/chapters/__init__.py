"""The chapters of the page: each declares its findings, figures and tables (see `reports.parts.Chapter`)."""
