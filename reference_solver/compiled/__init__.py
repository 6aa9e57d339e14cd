"""From the equations to machine code: written by the tape, compiled by Numba, kept on disk."""
