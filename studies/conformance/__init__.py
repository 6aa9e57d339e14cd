"""What every engine owes, as a suite that anybody can run on an engine: ``crankslider conform``."""
