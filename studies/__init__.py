"""Scripted comparisons of the engines, and the command line."""
