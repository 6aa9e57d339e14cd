"""Predictability: how long a scene can be followed, and what holds past that."""
