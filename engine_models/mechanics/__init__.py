"""Mechanics that the models of all engines share: geometry, laws, reactions, energies, trajectories."""
