"""The command ``crankslider``."""
