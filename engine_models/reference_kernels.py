"""The folder that keeps the reference's compiled kernels, for whoever runs the reference."""

from reference_solver.kernel_folder import FolderRefused, writable_folder

__all__ = ["FolderRefused", "writable_folder"]
