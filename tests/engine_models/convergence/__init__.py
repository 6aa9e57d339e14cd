"""Errors that engines tell of their own runs."""
