"""Impacts on rigid walls, and what the pins do after them."""
