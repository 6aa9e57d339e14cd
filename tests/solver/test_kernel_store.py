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
from reference_solver.kept_files import (
    FolderRefused,
    kernel_folder,
    private_folder,
    say_once,
    writable_folder,
)
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


def the_file() -> Path:
    (file,) = kernel_folder().iterdir()
    return file


def test_what_one_process_has_compiled_the_next_one_loads(caplog: pytest.LogCaptureFixture) -> None:
    assert [loaded(), loaded()] == [False, True]
    assert not caplog.messages


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "emptied": lambda _: b"",
    "truncated": lambda kept: kept[:-1],
    "cut within the checksum": lambda kept: kept[:7],
    "one bit altered": lambda kept: kept[:-9] + bytes([kept[-9] ^ 1]) + kept[-8:],
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_said_once_and_made_again(damage: str, caplog: pytest.LogCaptureFixture) -> None:
    loaded()
    kept = the_file().read_bytes()
    for _ in range(2):
        the_file().write_bytes(DAMAGES[damage](kept))
        assert not loaded()
        assert loaded()
    assert len(caplog.messages) == 1
    assert str(kernel_folder()) in caplog.text
    assert "got damaged ones: making them again" in caplog.text


def test_a_file_of_somebody_else_is_made_again(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded()
    real = os.fstat
    somebody = lambda file: os.stat_result([*real(file)[:4], real(file).st_uid + 1, *real(file)[5:]])  # noqa: E731
    monkeypatch.setattr(os, "fstat", somebody)
    assert not loaded()


def test_another_text_has_code_of_its_own() -> None:
    other = TEXT.replace("fmul", "fmul contract")
    assert [loaded(), loaded(other), loaded(), loaded(other, 3.0)] == [False, False, True, True]
    assert len(list(kernel_folder().iterdir())) == 2


def test_the_folders_are_private_whatever_the_mask(cache: Path) -> None:
    mask = os.umask(0)
    try:
        private_folder()
    finally:
        os.umask(mask)
    assert [path.stat().st_mode & 0o777 for path in (cache, kernel_folder())] == [0o700, 0o700]


@pytest.mark.parametrize("where", ["kernels", "."])
def test_a_folder_that_others_can_write_to_is_refused_unless_only_owners_replace(
    where: str, cache: Path
) -> None:
    loaded()
    for mode in (0o770, 0o702):
        (cache / where).chmod(mode)
        refused = f"{cache / where}: expected a folder that only you can write to, got permissions {mode:04o}"
        with pytest.raises(FolderRefused, match=re.escape(refused)):
            loaded()
    (cache / where).chmod(0o700)
    cache.chmod(0o1777)
    assert loaded()


def test_a_folder_of_somebody_else_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded()
    owner = os.geteuid()
    monkeypatch.setattr(os, "geteuid", lambda: owner + 1)
    with pytest.raises(FolderRefused, match=f"got one of user {owner}: set CRANKSLIDER_CACHE"):
        loaded()


def test_without_a_folder_every_process_compiles_its_own(
    cache: Path, caplog: pytest.LogCaptureFixture
) -> None:
    cache.write_text("in the way")
    assert [loaded(), loaded()] == [False, False]
    assert caplog.messages == [
        f"{kernel_folder()}: expected a folder to keep kernels in, got 'File exists': "
        "every process makes its own"
    ]


def test_a_full_disk_is_named_and_keeps_no_part_of_a_file(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def full(path: Path, data: bytes) -> int:
        with path.open("wb") as file:
            file.write(data[: len(data) // 2])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    assert [loaded(), loaded()] == [False, False]
    assert len(caplog.messages) == 1
    assert "got 'No space left on device'" in caplog.text
    assert not list(kernel_folder().iterdir())


def test_processes_started_where_nothing_can_be_kept_share_a_temporary_folder(
    cache: Path, caplog: pytest.LogCaptureFixture
) -> None:
    cache.write_text("in the way")
    with writable_folder():
        temporary = Path(os.environ["CRANKSLIDER_CACHE"])
        assert [loaded(), loaded()] == [False, True]
    assert "got 'File exists': a temporary one is used" in caplog.text
    assert os.environ["CRANKSLIDER_CACHE"] == str(cache)
    assert not temporary.exists()


def test_the_commands_refuse_such_a_folder_in_one_line(cache: Path, tmp_path: Path) -> None:
    private_folder().chmod(0o777)
    done = crankslider("run", "accuracy", "--out", tmp_path / "out")
    assert (done.code, done.stdout) == (2, "")
    assert done.stderr.startswith(f"error: {kernel_folder()}: expected a folder that only you can write")
    assert done.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == [cache]
