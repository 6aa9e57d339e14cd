"""The exception for input that is refused."""


class BadInput(ValueError):
    """Input was refused. The message names the field, what was expected and what came, in one line."""

    def __str__(self) -> str:
        """Return the message, with what cannot be printed on one line as Python writes it."""
        characters = super().__str__()
        return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in characters)
