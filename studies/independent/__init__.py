"""Crank-sliders with clearance in minimal coordinates: sharing nothing with the solvers that they judge."""
