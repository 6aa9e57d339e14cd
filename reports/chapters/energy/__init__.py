"""The chapter of the energy study."""
