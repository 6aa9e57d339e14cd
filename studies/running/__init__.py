"""What runs cases, on this machine or a cluster, and the store that keeps their rows."""
