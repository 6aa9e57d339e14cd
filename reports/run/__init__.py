"""Pictures of one run from its table of samples: curves over time, orbits of pins, films of the mechanism."""
