"""Planar mechanisms by the RK4 Lagrange-multiplier algorithm of Grigore, Stanescu and Pandrea (2008)."""
