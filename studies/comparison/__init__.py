"""One scene of the user's, every engine that can run it, at a short ladder of its best settings."""
