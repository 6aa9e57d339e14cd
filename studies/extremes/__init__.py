"""Extremes: a gallery of cases whose outcome theory knows."""
