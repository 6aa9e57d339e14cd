"""The chapter of the agreement study."""
