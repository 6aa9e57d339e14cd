"""Files and folders are there whole or not at all."""

import subprocess
import sys
from pathlib import Path

import pytest

from studies.whole_file import whole_folder
from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal

KILLED = """
import os, sys
from pathlib import Path
from studies.whole_file import whole_folder
with whole_folder(Path(sys.argv[1])) as new:
    (new / "half.html").touch()
    os.kill(os.getpid(), 9)
"""


def test_a_folder_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    place = tmp_path / "report"
    place.mkdir()
    (place / "index.html").write_text("before")
    subprocess.run([sys.executable, "-c", KILLED, place], check=False)
    with pytest.raises(ZeroDivisionError), whole_folder(place) as new:
        1 / len(list(new.iterdir()))
    assert (place / "index.html").read_text() == "before"
    with whole_folder(place) as new:
        (new / "index.html").write_text("after")
    assert [path.name for path in place.iterdir()] == ["index.html"]
    assert (place / "index.html").read_text() == "after"


SWEEP = ("sweep", "clearance-driven-0.5mm", "--vary", "clearance.B.radial_clearance_m=1e-5,1e-4", "--jobs", 1)
LOOSE = ("simulate", "clearance-driven-0.5mm", "--end", 1000)


@pytest.mark.parametrize(
    ("command", "name"),
    [
        ((*LOOSE, "--out"), "a.csv"),
        ((*LOOSE, "--animate"), "a.gif"),
        (("truth", "clearance-driven-0.5mm", "--end", 1000, "--out"), "a.csv"),
        ((*SWEEP, "--revolutions", 1e6, "--plot"), "a.png"),
    ],
    ids=lambda value: f"{value[0]} {value[-1]}" if isinstance(value, tuple) else "",
)
def test_a_file_that_cannot_be_written_is_refused_before_the_work(
    command: tuple[object, ...], name: str, tmp_path: Path
) -> None:
    """Any of these runs would take hours."""
    folder, file = tmp_path / f"folder-{name}", tmp_path / "file"
    folder.mkdir()
    file.touch()
    for place, reason in (
        (folder, "Is a directory"),
        (file / name, "Not a directory"),
        (tmp_path / "nowhere" / name, "No such file or directory"),
    ):
        done = crankslider(*command, place)
        option = f"{str(command[-1])[2:]}: expected a place that can be written"
        require_refusal(done.stdout, done.stderr, done.code, option, f"({reason})")
