"""For all tests: compiling leaves objects by the million, and the collector need not look so often."""

import gc

gc.set_threshold(50_000, 20, 100)
