"""Sweeps: one scene with many values of its fields, a row for each."""
