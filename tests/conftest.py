"""For all tests: what Numba compiles leaves objects by the million, through which the collector would look often."""

import gc

gc.set_threshold(50_000, 20, 100)
