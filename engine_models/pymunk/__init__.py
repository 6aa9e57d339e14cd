"""The scene in Pymunk (Chipmunk)."""
