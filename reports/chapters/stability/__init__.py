"""The chapter of the stability study."""
