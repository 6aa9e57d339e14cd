"""``crankslider sweep`` as a user calls it."""

from pathlib import Path

import pandas as pd
import pytest

import crankslider as cs
from tests.helpers.command import crankslider
from tests.helpers.refusals import require_refusal

SCENE, CLEARANCE, SPEED = (
    "clearance-driven-0.5mm",
    "clearance.B.radial_clearance_m",
    "start.crank_speed_rad_s",
)
#: Half a turn with a picture, and more digits than Python makes an integer of.
HALF, DIGITS = ("--revolutions", ".5", "--plot", "a.png"), "9" * 5000


def test_two_processes_write_the_rows_and_a_picture_that_one_gives_in_the_library(tmp_path: Path) -> None:
    rows, picture = tmp_path / "rows.parquet", tmp_path / "map.svg"
    vary = {CLEARANCE: "1e-5,1e-4,1e-3", SPEED: "200:400:2"}
    called = [part for field, values in vary.items() for part in ("--vary", f"{field}={values}")]
    done = crankslider(
        "sweep", SCENE, *called, "--revolutions", "0.1", "--jobs", 2, "--out", rows, "--plot", picture
    )
    assert (done.code, done.stdout) == (0, ""), done.stderr
    assert picture.read_bytes().startswith(b"<?xml")
    same = cs.sweep(SCENE, vary | {CLEARANCE: [1e-5, 1e-4, 1e-3]}, revolutions=0.1, jobs=1)
    pd.testing.assert_frame_equal(pd.read_parquet(rows), same.frame, check_exact=True)
    assert same.frame[CLEARANCE].tolist() == [1e-5, 1e-5, 1e-4, 1e-4, 1e-3, 1e-3]


def test_a_tolerance_among_the_settings_is_that_of_the_members() -> None:
    loose, sharp = (
        cs.sweep(SCENE, {CLEARANCE: [5e-4]}, revolutions=0.5, jobs=1, settings=settings).frame
        for settings in ({}, {"step_tolerance": 1e-9})
    )
    settings = {"method": "dop853", "step_tolerance": 1e-9}
    same = cs.sweep(SCENE, {CLEARANCE: [5e-4]}, revolutions=0.5, jobs=1, settings=settings).frame
    pd.testing.assert_frame_equal(sharp, same, check_exact=True)
    assert (loose["impact_speed_m_s"] != sharp["impact_speed_m_s"]).all()


@pytest.mark.parametrize(
    ("options", "pieces"),
    [
        ([], "--vary: expected FIELD=VALUES, or --members and --jitter, got nothing"),
        (["--vary", "clearance"], '--vary: expected FIELD=VALUES, got "clearance"'),
        (["--vary", f"{CLEARANCE}=1e-3:1e-5:9"], f"--vary {CLEARANCE}: expected a range that rises"),
        (["--vary", f"{CLEARANCE}=0:1e-3:9"], f"--vary {CLEARANCE}: expected a finite number > 0, got 0"),
        (["--vary", f"{CLEARANCE}=1e-3:1:9"], f"--vary {CLEARANCE}: expected a number < bearing_radius_m"),
        (["--vary", "clearance.B.radius=1,2"], "--vary clearance.B.radius: expected the key"),
        (["--vary", f"{SPEED}=-1:1:3"], f"--vary {SPEED}: expected a number other than 0"),
        (["--vary", "end_time_s=1,2"], "--vary end_time_s: expected --transient and --revolutions"),
        (["--vary", f"{SPEED}=1,2", *HALF], "--revolutions: expected a number >= 1 for this figure"),
        (["--vary", f"{SPEED}=1,2", *HALF, "--show", "strobe_m"], "--revolutions: expected a number >= 1"),
        (
            ["--vary", f"{SPEED}=1,2", "--vary", f"{CLEARANCE}=1e-5,1e-4", *HALF, "--show", "motion"],
            "--revolutions: expected a number >= 10",
        ),
        (
            ["--vary", f"{SPEED}=1,2", "--plot", "a.png", "--show", "exponent_1_s"],
            "--show: expected --exponent beside exponent_1_s, got none",
        ),
        (["--members", "5", "--jitter", "1e308"], "--jitter: expected a finite number >= 0 and <= 6.28"),
        (["--vary", f"{SPEED}=1:2:{DIGITS}"], f"--vary {SPEED}: expected 1 to 10000000 members, got 9999"),
        (["--vary", f"{SPEED}=1:{DIGITS}:2"], f"--vary {SPEED}: expected LOW:HIGH[:log][:COUNT]"),
        (["--members", DIGITS, "--jitter", "1"], "--members: expected an integer >= 1 and <= 10000000"),
        (["--members", "9" * 400, "--jitter", "1"], "--members: expected an integer >= 1 and <= 10000000"),
        (["--vary", f"{SPEED}=1,2", "--seed", DIGITS], "--seed: expected an integer >= 0"),
        (["--vary", f"{SPEED}=1,2", "--jobs", DIGITS], "--jobs: expected an integer >= 1 and <= 1000"),
        (["--members", "5", "--jitter", "-1"], "--jitter: expected a finite number >= 0"),
        (["--vary", f"{SPEED}=1,2", "--sample", "dice"], '--sample: expected "grid", "random"'),
        (["--vary", f"{SPEED}=1,2", "--out", "rows.csv"], "--out: expected a file that ends in .parquet"),
        (["--vary", f"{SPEED}=1,2", "--plot", "map.txt"], "--plot: expected a file that ends in"),
        (["--vary", f"{CLEARANCE}=1e-5,1e-4", "--engine", "pymun"], "did you mean pymunk?"),
        (
            ["--vary", f"{SPEED}=1,2", "--exponent", "--engine", "scipy"],
            "--exponent: expected the reference, or",
        ),
    ],
)
def test_what_cannot_be_swept_is_refused_in_one_line(options: list[str], pieces: str) -> None:
    done = crankslider("sweep", SCENE, *options)
    require_refusal(done.stdout, done.stderr, done.code, pieces)


def test_a_scene_without_clearance_is_refused() -> None:
    done = crankslider("sweep", "ideal-driven", "--vary", f"{SPEED}=1,2")
    require_refusal(done.stdout, done.stderr, done.code, "SCENE: expected a joint with clearance, got none")


def test_a_picture_of_what_no_member_did_is_refused_in_one_line(tmp_path: Path) -> None:
    """In a thousandth of a millionth of a turn no pin touches."""
    short = ("--revolutions", "1e-9", "--jobs", 1, "--quiet", "--out", tmp_path / "a.parquet")
    pictures = ("--plot", tmp_path / "a.png", "--show", "impact_speed_m_s")
    done = crankslider("sweep", SCENE, "--vary", f"{SPEED}=300,400", *short, *pictures)
    require_refusal(
        done.stdout, done.stderr, done.code, "--show: expected members with a number in impact_speed_m_s"
    )
