"""What all refusals of a user's input are."""


class BadInput(ValueError):
    """Input was refused. The message names the field, what was expected and what came, in one line."""
