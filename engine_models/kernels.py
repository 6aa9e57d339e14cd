"""Where machine code is kept, for whoever has any: the folder and its files."""

from reference_solver.kept_files import FolderRefused, read_kept, writable_folder, write_kept
from reference_solver.machine_code import compiled

__all__ = ["FolderRefused", "compiled", "read_kept", "writable_folder", "write_kept"]
