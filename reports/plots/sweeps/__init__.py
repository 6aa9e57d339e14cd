"""Pictures of sweeps: what a mechanism does over one field of its scene, or over two."""
