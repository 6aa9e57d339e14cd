"""What is taken for a scene file and for a number, whatever is offered."""

import os
from pathlib import Path

import pytest

from engine_models.scene.file import SceneError, load
from engine_models.scene.library import ideal_free
from engine_models.scene.text_files import LARGEST_BYTES
from tests.helpers.command import crankslider

TEXT = ideal_free().to_toml()


def refusal(path: Path) -> str:
    with pytest.raises(SceneError) as refused:
        load(path)
    return str(refused.value)


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_bytes(b"\xef\xbb\xbf" + TEXT.encode())
    assert load(file) == ideal_free()


def test_a_pipe_that_nobody_may_ever_write_to_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    os.mkfifo(file)
    assert refusal(file) == f"{file}: expected a file that can be read, got a pipe"


def test_a_device_is_refused() -> None:
    assert refusal(Path("/dev/zero")) == "/dev/zero: expected a file that can be read, got a device"


def test_a_pipe_that_a_shell_has_opened_is_read() -> None:
    reader, writer = os.pipe()
    with os.fdopen(reader), os.fdopen(writer, "w") as file:
        file.write(TEXT)
        file.close()
        assert load(Path(f"/dev/fd/{reader}")) == ideal_free()


def test_no_file_is_read_beyond_the_largest_scene(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(TEXT)
    os.truncate(file, 10**12)  # all of it would not fit in memory
    assert refusal(file) == f"{file}: expected a scene of at most {LARGEST_BYTES['a scene']} bytes, got more"


def test_an_endless_opened_file_is_not_read_to_its_end() -> None:
    with Path("/dev/zero").open("rb") as endless:
        assert "at most 5000000 bytes, got more" in refusal(Path(f"/dev/fd/{endless.fileno()}"))


def test_many_unknown_keys_are_counted_in_one_line(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    count = 1_000_000 // 12
    file.write_text("".join(f"k{k} = 1\n" for k in range(count)) + TEXT)
    done = crankslider("show", file)
    assert done.code == 2
    assert done.stderr.startswith(f"error: {file}: line 1: k0: expected the key name, end_time_s, ")
    assert done.stderr.endswith(f"; and {count - 3} more\n")
    assert len(done.stderr) < 1000
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("key", "piece"),
    [
        ("k" * 10_000, f": {'k' * 60}...: expected the key"),
        (r'"\u001b[2J\u2028"', r': "\u001b[2J\u2028": expected the key'),
    ],
    ids=["long", "unprintable"],
)
def test_a_key_is_shown_short_and_harmless(key: str, piece: str, tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(f"{key} = 1\n{TEXT}")
    assert crankslider("show", file).stderr.startswith(f"error: {file}{piece}")


def test_a_long_piece_of_broken_toml_is_not_repeated(tmp_path: Path) -> None:
    file = tmp_path / "scene.toml"
    key = "k" * 10_000
    file.write_text(f"x = {{{key} = 1, {key} = 2}}\n{TEXT}")
    assert len(crankslider("show", file).stderr) < 250 + len(str(file))
    file.write_text(f"x = 1\nx = }}\n{TEXT}")
    assert "at line 2, column" in crankslider("show", file).stderr


@pytest.mark.parametrize("number", ["1_0", "1_000.0", " 10", "１０", "١٠", "1e", "0x10", "1,5", "", "."])
@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        (("simulate", "ideal-free", "--samples="), "--samples"),
        (("simulate", "ideal-free", "--step="), "--step"),
        (("simulate", "ideal-free", "--engine", "pymunk", "--set", "iterations="), "--set iterations"),
        (("run", "agreement", "--jobs="), "--jobs"),
    ],
)
def test_only_plain_decimal_numbers_are_numbers(number: str, arguments: tuple[str, ...], option: str) -> None:
    done = crankslider(*arguments[:-1], arguments[-1] + number)
    assert done.code == 2
    assert done.stderr.startswith(f"error: {option}: expected ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("number", ["10", "+10", "010", "10.0", "1e1", "100E-1", ".1e2"])
def test_a_number_may_be_written_in_every_plain_way(number: str) -> None:
    done = crankslider("simulate", "ideal-free", "--end", number, "--step", "20")
    assert done.stderr == "error: --step: expected a number from 1e-11 to the end time 10, got 20\n"
