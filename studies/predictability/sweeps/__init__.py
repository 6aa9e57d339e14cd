"""Sweeps: one scene with many values in its fields, a row for each."""
