"""The scene in the reference solver."""
