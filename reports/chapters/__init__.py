"""Chapters of the page: a file each, which declares ``CHAPTER``."""
