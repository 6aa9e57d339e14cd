"""Files that processes keep for later ones in a folder of this user's alone: what is read there runs.

Each begins with a checksum of the rest and takes its place in one move. So what a kill, a full disk or a hand
has damaged is made again, and of processes that make the same the last one's is kept.
"""

import hashlib
import logging
import os
import sqlite3
import stat
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import cache
from pathlib import Path
from secrets import token_hex

import platformdirs

#: The environment variable that puts the folder elsewhere.
VARIABLE = "CRANKSLIDER_CACHE"
#: For how long others wait for a process that compiles, in s, and what this process has waited for or made.
LONGEST_S, _THERE = 60.0, set[str]()
WRITABLE_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH
ROOT_USER = 0
NOT_KEPT = "{}: expected a folder to keep kernels in, got '{}': {}"


class FolderRefused(Exception):
    """Somebody else could have put machine code into the folder; the message says how to mend that."""


def kernel_folder() -> Path:
    """Return where machine code is kept: below ``CRANKSLIDER_CACHE`` or in the user's cache."""
    return Path(os.environ.get(VARIABLE) or platformdirs.user_cache_dir("crankslider")) / "kernels"


def private_folder() -> Path:
    """Return ``kernel_folder()``, made if it is not there, which nobody else can write to or replace.

    Raises:
        FolderRefused: it or the folder that it is in belongs to somebody else, or others may write to it.
        OSError: it cannot be made.
    """
    folder = kernel_folder()
    folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    checked: dict[Path, tuple[int, ...]] = {folder: ()}
    if not folder.parent.stat().st_mode & stat.S_ISVTX:  # with it nobody can replace what is another's
        checked[folder.parent] = (ROOT_USER,)
    for each, owners in checked.items():
        status, elsewhere = each.stat(), f"set {VARIABLE} to a folder of your own"
        if not _is_own(status, *owners):
            got = f"one of user {status.st_uid}: {elsewhere}"
        elif status.st_mode & WRITABLE_BY_OTHERS and sys.platform != "win32":  # there permissions say nothing
            got = f"permissions {stat.S_IMODE(status.st_mode):04o}: run chmod go-w on it, or {elsewhere}"
        else:
            continue
        raise FolderRefused(f"{each}: expected a folder that only you can write to, got {got}")
    return folder


def _is_own(status: os.stat_result, *others: int) -> bool:
    return sys.platform == "win32" or status.st_uid in (os.geteuid(), *others)


def read_kept(name: str) -> bytes | None:
    """Return what ``write_kept`` wrote, None if it is not there or no longer the same.

    Raises:
        FolderRefused: others could have written it.
    """
    try:
        with (private_folder() / name).open("rb") as file:
            content = file.read() if _is_own(os.fstat(file.fileno())) else b""
    except OSError:
        return None
    data = content[hashlib.sha256().digest_size :]
    if content == _checksum(name, data) + data:
        return data
    say_once(f"{kernel_folder()}: expected files as they were kept, got damaged ones: making them again")
    return None


def write_kept(name: str, data: bytes) -> None:
    """Keep data under a name; where that cannot be done say so once and go on.

    Raises:
        FolderRefused: others could replace it.
    """
    try:
        new = private_folder() / f"{name}.{token_hex(8)}"
        try:
            new.write_bytes(_checksum(name, data) + data)
            new.replace(new.with_name(name))
        finally:
            new.unlink(missing_ok=True)
    except OSError as error:
        say_once(NOT_KEPT.format(kernel_folder(), error.strerror or error, "every process makes its own"))


def _checksum(name: str, data: bytes) -> bytes:
    return hashlib.sha256(name.encode() + data).digest()  # of another name it is another


@contextmanager
def alone(what: str) -> Iterator[None]:
    """Have one process at a time in the first block of a name: what that compiles all others load."""
    with ExitStack() as held:
        if what not in _THERE:
            with suppress(FolderRefused, OSError, sqlite3.Error):  # then every process compiles its own
                file = private_folder() / f"{what}.lock"
                lock = held.enter_context(closing(sqlite3.connect(file, timeout=LONGEST_S)))
                lock.execute("begin exclusive")
        yield
        _THERE.add(what)


@contextmanager
def writable_folder() -> Iterator[None]:
    """Have machine code kept: in this block in a temporary folder where the usual one cannot be written.

    It holds for processes started in the block too; there is a note in the log.

    Raises:
        FolderRefused: as ``private_folder``.
    """
    from unittest.mock import patch  # it takes a moment

    try:
        with tempfile.TemporaryFile(dir=private_folder(), buffering=0) as file:
            file.write(bytes(2**16))  # on a full disk an empty file can be made
    except OSError as error:
        say_once(NOT_KEPT.format(kernel_folder(), error.strerror or error, "a temporary one is used"))
    else:
        yield
        return
    with (
        tempfile.TemporaryDirectory(prefix="crankslider-") as folder,
        patch.dict(os.environ, {VARIABLE: folder}),
    ):
        yield


@cache
def say_once(text: str) -> None:
    """Log a warning, the first time only."""
    logging.getLogger(__name__).warning(text)
