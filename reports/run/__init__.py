"""What is shown of one run: figures, an animation, and the command that repeats it."""
