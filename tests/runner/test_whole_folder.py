"""Files and folders are there whole or not at all."""

import subprocess
import sys
from pathlib import Path

import pytest

from crankslider.command import whole_folder

KILLED = """
import os, sys
from pathlib import Path
from crankslider.command import whole_folder
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
