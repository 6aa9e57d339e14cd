"""One run holds a folder: by a lock of the operating system, which dies with its process."""

import json
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import BinaryIO

#: Where on Windows the lock lies: past the text, since what is locked there cannot be read.
_FAR = 2**30


class FolderHeld(Exception):
    """Another run holds the folder; the message says who, since when, and what to do."""


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Hold a folder while the block runs; the file ``rows.lock`` stays and tells who held it last.

    The lock is not inherited by processes that are started meanwhile.

    Raises:
        FolderHeld: another run holds it.
        OSError: nothing can be written there, or the file system has no locks.
    """
    with os.fdopen(os.open(folder / "rows.lock", os.O_RDWR | os.O_CREAT, 0o666), "r+b", buffering=0) as file:
        if not _locked(file):
            raise FolderHeld(f"a folder that no other run holds, got {folder}, held by {_holder(file)}")
        now = datetime.now().astimezone().isoformat(sep=" ", timespec="seconds")
        holder = {"pid": os.getpid(), "host": socket.gethostname(), "since": now}
        file.truncate(0)
        file.write(json.dumps(holder).encode())
        yield


def _holder(file: BinaryIO) -> str:
    try:
        holder = json.loads(file.read(1000))
        who = f"process {holder['pid']} on {holder['host']} since {holder['since']}"
    except (ValueError, KeyError, TypeError):  # it writes just now
        who = "another run"
    return f"{who}: wait for it, or name another folder"


def _locked(file: BinaryIO) -> bool:
    """Lock a file unless another process has; return whether it is ours."""
    try:
        if sys.platform == "win32":
            import msvcrt

            file.seek(_FAR)
            try:
                msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
            except OSError:
                return False
            finally:
                file.seek(0)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        raise OSError(error.errno, f"no lock to be had: {error.strerror}", file.name) from None
    return True
