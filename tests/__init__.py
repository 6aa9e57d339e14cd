"""All tests; compiling leaves objects by the million, so the collector looks less often than is usual."""

import gc

gc.set_threshold(50_000, 20, 100)
