"""Stability: where each solver stops being trustworthy."""
