"""What runs in every step of Pymunk, compiled by Numba."""
