"""What takes minutes and chance: run by ``make soak``, not by the everyday suite."""
