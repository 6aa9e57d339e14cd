"""The chapter of the clearance study."""
