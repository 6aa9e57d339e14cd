"""The mechanism in minimal coordinates: the pick of a user who would rather not have constraints."""
