"""How cases run: on all cores or a cluster, kept as rows at once, resumed where they stopped."""
