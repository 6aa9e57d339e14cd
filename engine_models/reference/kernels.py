"""The folder that keeps the reference's compiled kernels, for whoever runs the reference."""

from reference_solver.compiled.checked_files import read_checked, write_checked
from reference_solver.compiled.folder import FolderRefused, writable_folder

__all__ = ["FolderRefused", "read_checked", "writable_folder", "write_checked"]
