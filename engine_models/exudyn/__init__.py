"""The scene in Exudyn."""
