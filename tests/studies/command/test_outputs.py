"""What ``simulate`` writes: tables by the ending of their names, a figure, a film, and what made them."""

import json
from pathlib import Path

import pandas as pd
import pytest

from engine_models.scene.file import from_toml
from tests.helpers.command import crankslider, table_of
from tests.helpers.refusals import require_refusal

LOOSE = ("simulate", "clearance-driven-0.5mm", "--end", 0.002, "--samples", 20)


@pytest.mark.parametrize("option", ["--out", "--impacts"])
def test_all_formats_hold_the_same_numbers(option: str, tmp_path: Path) -> None:
    for name in ("a", "a.csv", "a.json", "a.PARQUET"):
        assert crankslider(*LOOSE, option, tmp_path / name).code == 0
    table = table_of((tmp_path / "a.csv").read_text())
    assert len(table) > 1
    columns = json.loads((tmp_path / "a.json").read_text())["columns"]
    assert (tmp_path / "a").read_text() == (tmp_path / "a.csv").read_text()
    for other in (pd.DataFrame(columns), pd.read_parquet(tmp_path / "a.PARQUET")):
        pd.testing.assert_frame_equal(other, table, check_exact=True, check_dtype=False)


def test_a_file_tells_what_made_it_and_its_scene_runs_to_the_same_file(tmp_path: Path) -> None:
    settings = ("--set", "steps_per_contact=50")
    changed = (*LOOSE, *settings, "--with", "clearance.B.radial_clearance_m=1e-4")
    for name in ("a.json", "a.parquet"):
        assert crankslider(*changed, "--out", tmp_path / name).code == 0
    made_by = json.loads((tmp_path / "a.json").read_text())["made_by"]
    assert (made_by["engine"], made_by["settings"]["steps_per_contact"]) == ("reference", 50.0)
    assert (made_by["step_s"], made_by["samples"], made_by["tolerance_m"]) == (1e-5, 20, None)
    assert made_by["quality"]["unaccounted_energy_part"] < 1e-6
    assert crankslider("--version").stdout == f"crankslider {made_by['version']}\n"
    assert from_toml(made_by["scene"]).clearances["B"].radial_clearance_m == 1e-4
    assert pd.read_parquet(tmp_path / "a.parquet").attrs == made_by
    (tmp_path / "mine.toml").write_text(made_by["scene"])
    again = ("simulate", tmp_path / "mine.toml", *settings, "--samples", 20, "--out", tmp_path / "b.json")
    assert crankslider(*again).code == 0
    assert (tmp_path / "b.json").read_text() == (tmp_path / "a.json").read_text()


def test_a_dash_is_standard_output(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert crankslider(*LOOSE, "--out", "-").stdout == crankslider(*LOOSE).stdout
    impacts = crankslider(*LOOSE, "--out", "run.csv", "--impacts", "-").stdout
    assert crankslider(*LOOSE, "--impacts", "-").stdout == impacts, "the samples were not asked for"
    assert impacts.startswith("joint,time_s,duration_s,")
    assert [file.name for file in tmp_path.iterdir()] == ["run.csv"]


def test_figure_film_and_tables_come_from_one_run(tmp_path: Path) -> None:
    wanted = {"--out": "a.csv", "--impacts": "b.csv", "--plot": "c.png", "--animate": "d.gif"}
    options = [word for option, name in wanted.items() for word in (option, tmp_path / name)]
    done = crankslider(*LOOSE, *options, "--samples", 6, "--exaggerate", 20)
    assert (done.code, done.stdout) == (0, "")
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "d.gif").read_bytes().startswith(b"GIF89a")
    samples, impacts = (table_of((tmp_path / name).read_text()) for name in ("a.csv", "b.csv"))
    assert 0 < impacts["energy_lost_J"].sum() <= samples["dissipated_energy_J"].iloc[-1] * (1 + 1e-9)
    assert {file.name for file in tmp_path.iterdir()} == set(wanted.values())


# What cannot be written


def test_a_link_is_written_through_and_a_device_stays_one(tmp_path: Path) -> None:
    link = tmp_path / "link.csv"
    link.symlink_to(tmp_path / "out.csv")
    assert crankslider(*LOOSE, "--out", link).code == 0
    assert link.is_symlink()
    assert crankslider(*LOOSE, "--out", "/dev/null").code == 0
    assert Path("/dev/null").is_char_device()


@pytest.mark.parametrize("option", ["--out", "--impacts"])
def test_a_full_disk_is_told_of_the_file_that_it_struck(option: str, tmp_path: Path) -> None:
    other = {"--out": "--impacts", "--impacts": "--out"}[option]
    done = crankslider(*LOOSE, option, "/dev/full", other, tmp_path / "a.csv")
    require_refusal(done.stdout, done.stderr, done.code, f"{option[2:]}: expected", "No space left on device")
    assert [path.name for path in tmp_path.iterdir()] == ([] if option == "--out" else ["a.csv"])
