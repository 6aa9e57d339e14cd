"""Files of the kernel folder: whole and as they were written, or not there.

Each begins with a checksum of the rest and takes its place in one move. So what a kill, a full disk or a hand
has damaged is made again, and of processes that make the same the last one's is kept. A process that is about
to make what another one makes just now waits for it.
"""

import hashlib
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from secrets import token_hex
from typing import BinaryIO

from reference_solver.compiled.folder import is_own, kernel_folder, private_folder, say_not_kept, say_once

CHECKSUM_BYTES = hashlib.sha256().digest_size
#: How long a process waits for another one, and how often it looks, in s: compiling takes half a minute.
WAIT_S, LOOK_S = 120.0, 0.02


def read_checked(name: str) -> bytes | None:
    """Return what ``write_checked`` wrote, None if it is not there or no longer the same.

    Raises:
        FolderRefused: others could have written it.
    """
    try:
        with (private_folder() / name).open("rb") as file:
            content = file.read() if is_own(os.fstat(file.fileno())) else b""
    except OSError:
        return None
    data = content[CHECKSUM_BYTES:]
    if content == checksum(name, data) + data:
        return data
    say_once(f"{kernel_folder()}: expected files as they were kept, got damaged ones: making them again")
    return None


def write_checked(name: str, data: bytes) -> None:
    """Keep data under a name; where that cannot be done say so once and go on.

    Raises:
        FolderRefused: others could replace it.
    """
    try:
        folder = private_folder()
        new = folder / f"{name}.{token_hex(8)}"
        try:
            new.write_bytes(checksum(name, data) + data)
            new.replace(folder / name)
        finally:
            new.unlink(missing_ok=True)
    except OSError as error:
        say_not_kept(error, "every process makes its own")


@contextmanager
def made_once(name: str) -> Iterator[None]:
    """Let no other process be in a block of this name, by a lock of the system that dies with its process.

    It is waited for in vain no longer than ``WAIT_S``, and without locks not at all: then both make the same.

    Raises:
        FolderRefused: as ``read_checked``.
    """
    try:
        path = private_folder() / f"{name}.lock"
        file = path.open("wb")
    except OSError:
        yield
        return
    with file:
        _lock(file)
        try:
            yield
        finally:
            with suppress(OSError):  # another one has, or on Windows it is open
                path.unlink()


def _lock(file: BinaryIO) -> None:
    if sys.platform == "win32":
        return
    import fcntl

    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            time.sleep(LOOK_S)
        except OSError:
            return


def checksum(name: str, data: bytes) -> bytes:
    """Return what data begin with under a name, so that those of another name are noticed too."""
    return hashlib.sha256(name.encode() + data).digest()
