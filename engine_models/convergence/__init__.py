"""Runs that are held to a tolerance, and what any run is uncertain by."""
