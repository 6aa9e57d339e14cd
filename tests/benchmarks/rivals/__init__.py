"""Scripts of engines on their own, written from their documentation; they share no code with the project."""
