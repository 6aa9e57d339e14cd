"""The crank-slider scene as data, and its model in each engine."""
