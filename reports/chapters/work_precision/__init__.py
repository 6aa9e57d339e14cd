"""The chapter of the work-precision study."""
