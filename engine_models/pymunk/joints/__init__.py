"""Bodies and joints that Pymunk is given, and how sweeps over them converge: read ``plan`` first."""
