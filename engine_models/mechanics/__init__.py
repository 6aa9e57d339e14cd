"""Mechanics that engines without multipliers share: geometry, laws, reactions, energies, trajectories."""
