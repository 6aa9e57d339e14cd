"""The chapter of the predictability study."""
