"""Contacts of pins in their bearings: forces, walls, and the compiled loops that land on every event."""
