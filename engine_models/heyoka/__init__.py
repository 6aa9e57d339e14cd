"""heyoka's compiled Taylor series on the mechanism in minimal coordinates."""
