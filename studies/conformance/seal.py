"""Seals a published folder with the hash of every file in it: ``python -m studies.conformance.seal FOLDER``.

A file that is altered, lost or added breaks the seal. Line endings do not count in text.
"""

import hashlib
import json
import sys
from pathlib import Path

SEALS = "seals.json"
#: Files that are no text.
BINARY = (".png", ".npz")


def write_seals(folder: Path) -> None:
    """Write the hashes of all files in a folder into it."""
    (folder / SEALS).write_text(json.dumps(_hashes(folder), indent=0) + "\n", encoding="utf-8")


def broken_seals(folder: Path) -> list[str]:
    """Return in a line each what was altered, lost or added since a folder was sealed."""
    sealed, now = json.loads((folder / SEALS).read_text(encoding="utf-8")), _hashes(folder)
    what = {(True, True): "altered", (True, False): "lost", (False, True): "added"}
    return [
        f"{name} was {what[name in sealed, name in now]}"
        for name in sorted(sealed.keys() | now.keys())
        if sealed.get(name) != now.get(name)
    ]


def _hashes(folder: Path) -> dict[str, str]:
    files = sorted(path for path in folder.rglob("*") if path.is_file() and path != folder / SEALS)
    return {path.relative_to(folder).as_posix(): _hash(path) for path in files}


def _hash(path: Path) -> str:
    content = path.read_bytes()
    if path.suffix not in BINARY:
        content = content.replace(b"\r\n", b"\n")
    return hashlib.sha256(content).hexdigest()


if __name__ == "__main__":
    write_seals(Path(sys.argv[1]))
