"""Machine code kept between processes: what is damaged is made again, what others could write is refused."""

import errno
import os
import re
from collections.abc import Callable
from pathlib import Path

import llvmlite.binding as llvm
import numpy as np
import pytest

from reference_solver import machine_code
from reference_solver.kept_files import FolderRefused, kernel_folder, say_once, writable_folder
from tests.helpers.command import crankslider

#: A function that stores p[0] y[0], and returns 1.
TEXT = f"""
define double @scaled({machine_code.ARGUMENTS}, ptr noalias %out) {{
  %factor = load double, ptr %p
  %number = load double, ptr %y
  %product = fmul double %factor, %number
  store double %product, ptr %out
  ret double 1.0
}}
"""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CRANKSLIDER_CACHE", str(tmp_path / "cache"))
    say_once.cache_clear()
    return tmp_path / "cache"


def loaded(text: str = TEXT, factor: float = 2.0) -> bool:
    """Return whether a function's code was there before; either way it computes what it should."""
    made = []
    real = llvm.parse_assembly

    def parse(text: str) -> object:
        made.extend([text] * bool(text))
        return real(text)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(llvm, "parse_assembly", parse)
        function = machine_code.compile_text(text, ["scaled"])["scaled"]
    p, y, out = np.array([factor]), np.array([21.0]), np.zeros(1)
    assert function(p.ctypes.data, 0, 0.0, y, out) == 1.0
    assert out[0] == factor * 21.0
    return not made


def test_each_text_has_code_of_its_own_that_the_next_process_loads(caplog: pytest.LogCaptureFixture) -> None:
    other = TEXT.replace("fmul", "fmul contract")
    assert [loaded(), loaded(other), loaded(), loaded(other, 3.0)] == [False, False, True, True]
    folder = kernel_folder()
    assert len([*folder.iterdir()]) == 2
    assert [path.stat().st_mode & 0o777 for path in (folder.parent, folder)] == [0o700, 0o700]
    assert not caplog.messages


@pytest.mark.parametrize(
    "damage",
    [lambda _: b"", lambda kept: kept[:7], lambda kept: kept[:-9] + bytes([kept[-9] ^ 1]) + kept[-8:]],
    ids=["emptied", "cut within the checksum", "one bit altered"],
)
def test_a_damaged_file_is_said_once_and_made_again(
    damage: Callable[[bytes], bytes], caplog: pytest.LogCaptureFixture
) -> None:
    loaded()
    (file,) = kernel_folder().iterdir()
    kept = file.read_bytes()
    for _ in range(2):
        file.write_bytes(damage(kept))
        assert [loaded(), loaded()] == [False, True]
    (line,) = caplog.messages
    assert line == f"{file.parent}: expected files as they were kept, got damaged ones: making them again"


def test_a_folder_that_others_can_write_to_is_refused_unless_only_owners_replace(cache: Path) -> None:
    loaded()
    for folder in (cache, cache / "kernels"):
        for mode in (0o770, 0o702):
            folder.chmod(mode)
            refused = f"{folder}: expected a folder that only you can write to, got permissions {mode:04o}"
            with pytest.raises(FolderRefused, match=re.escape(refused)):
                loaded()
        done = crankslider("run", "accuracy", "--out", cache.with_name("out"))
        assert (done.code, done.stdout, done.stderr.count("\n")) == (2, "", 1)
        assert done.stderr.startswith(f"error: {folder}: expected a folder that only you can write")
        folder.chmod(0o700)
    cache.chmod(0o1777)
    assert loaded()


def test_what_is_somebody_elses_is_made_again_or_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded()
    real, owner = os.fstat, os.geteuid()

    def somebody(file: int) -> os.stat_result:
        return os.stat_result([*real(file)[:4], real(file).st_uid + 1, *real(file)[5:]])

    with monkeypatch.context() as patch:
        patch.setattr(os, "fstat", somebody)
        assert not loaded()
    monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    with pytest.raises(FolderRefused, match=f"got one of user {owner}: set CRANKSLIDER_CACHE"):
        loaded()


def test_without_a_folder_every_process_compiles_its_own_or_shares_a_temporary_one(
    cache: Path, caplog: pytest.LogCaptureFixture
) -> None:
    cache.write_text("in the way")
    assert [loaded(), loaded()] == [False, False]
    with writable_folder():
        temporary = Path(os.environ["CRANKSLIDER_CACHE"])
        assert [loaded(), loaded()] == [False, True]
    got = f"{kernel_folder()}: expected a folder to keep kernels in, got 'File exists': "
    assert caplog.messages == [f"{got}every process makes its own", f"{got}a temporary one is used"]
    assert not temporary.exists()


def test_a_full_disk_is_named_and_keeps_no_part_of_a_file(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(path: Path, data: bytes) -> int:
        with path.open("wb") as file:
            file.write(data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    assert [loaded(), loaded()] == [False, False]
    (line,) = caplog.messages
    assert "got 'No space left on device'" in line
    assert not list(kernel_folder().iterdir())
