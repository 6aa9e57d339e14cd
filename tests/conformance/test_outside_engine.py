"""An engine from outside takes part without a change to any file: it is named by its module and class."""

import subprocess
import sys
from collections.abc import Collection
from io import StringIO
from pathlib import Path

import pandas as pd
import pytest

from engine_models import engines
from engine_models.engines import make_engine
from engine_models.scene.library import IDEAL_SCENES
from studies.case import code_of
from studies.conform import states_its_accuracy
from studies.running.store import Store
from tests.helpers.command import crankslider

pytestmark = pytest.mark.system

#: Exudyn in other clothes, ``on`` ideal scenes; ``off_m`` moves its slider, ``stronger`` are its forces.
ENGINE = '''
from dataclasses import dataclass, replace

from engine_models.engine import UnsupportedScene
from engine_models.engines import make_engine
from engine_models.scene.library import IDEAL_SCENES


@dataclass(frozen=True)
class MyEngine:
    """Exudyn for ideal joints alone."""

    off_m: float = {off_m}
    stronger: float = {stronger}
    order = {order}
    accuracy_m = {accuracy_m}

    def check(self, scene):
        if scene.clearances or not scene.name.startswith(tuple({on})):
            raise UnsupportedScene("no clearance")

    def twin(self, scene):
        self.check(scene)
        return scene

    def sharper(self):
        return self

    def simulate(self, scene, settings):
        self.check(scene)
        run = make_engine("exudyn").simulate(scene, settings)
        position = run.position.copy()
        position[1:, -1, 0] += self.off_m
        forces = {{joint: self.stronger * force for joint, force in run.joint_force_N.items()}}
        return replace(run, position=position, joint_force_N=forces)
'''
NAME = "my_module:MyEngine"


@pytest.fixture
def written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's folder with the engine in it, which is forgotten afterwards."""
    write(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.setattr(engines, "_CLASSES", classes := dict(engines._CLASSES))
    monkeypatch.setattr(engines, "ENGINES", classes.keys())
    monkeypatch.delitem(sys.modules, "my_module", raising=False)
    code_of.cache_clear()  # of another test's file of that name
    return tmp_path


def write(
    folder: Path,
    off_m: float = 0.0,
    order: object = 2,
    accuracy_m: float | None = None,
    on: Collection[str] = IDEAL_SCENES,
    stronger: float = 1.0,
) -> None:
    text = ENGINE.format(off_m=off_m, order=order, accuracy_m=accuracy_m, on=[*on], stronger=stronger)
    (folder / "my_module.py").write_text(text, encoding="utf-8")


@pytest.mark.usefixtures("written")
def test_an_engine_that_keeps_its_claims_conforms() -> None:
    done = crankslider("conform", NAME)
    assert done.code == 0, done.stdout
    assert done.stdout.count("holds") == 10


@pytest.mark.parametrize(("stated_m", "holds"), [(2e-5, True), (1e-5, False)])
def test_an_engine_is_held_to_the_accuracy_that_it_states(
    written: Path, stated_m: float, holds: bool
) -> None:
    """The trapezoidal rule errs by 15 micrometres in steps of 0.2 ms."""
    write(written, accuracy_m=stated_m)
    found = states_its_accuracy(make_engine(NAME))
    assert found.holds == holds, found.measured
    assert f"{stated_m:.1e} m is stated" in found.measured


@pytest.mark.parametrize(
    ("off_m", "order", "broken"),
    [
        (0.099, 2, "What the scene observes is where"),
        (0.0, 3, "2.00, and 3 is stated"),
        (0.0, None, "m, 3 times sharper"),
    ],
    ids=["9.9 cm off", "another order", "a tolerance that does nothing"],
)
def test_one_that_does_not_fails_and_is_told_where(
    written: Path, off_m: float, order: object, broken: str
) -> None:
    write(written, off_m, order)
    done = crankslider("conform", NAME)
    assert done.code == 1
    failing = "\n".join(line for line in done.stdout.splitlines() if line.startswith("FAILS"))
    assert broken in failing, done.stdout


def test_its_numbers_are_held_to_a_table_of_its_own(written: Path) -> None:
    """Forces that are off by a hundredth are within all claims, and out of their bands."""
    write(written, on=["ideal-free"])
    accepted = crankslider("baseline", NAME, "--accept", "the first")
    assert accepted.code == 0, accepted.stderr
    table = (written / "accuracy" / "baselines.csv").read_text(encoding="utf-8").splitlines()
    assert table[0] == "# the first"
    assert [line.split(",")[:3] for line in table[2:]] == [["ideal-free", NAME, "default"]] * 2
    write(written, stronger=1.01, on=["ideal-free"])
    done = crankslider("baseline", NAME)
    assert done.code == 1
    left = {
        line.split()[0] for line in done.stdout.splitlines() if f"of {NAME} (default) on ideal-free" in line
    }
    assert left == {"force_error_N"}


def test_a_table_of_another_solver_is_held_to_the_reference_solution(tmp_path: Path) -> None:
    run = crankslider("simulate", "ideal-driven", "--end", 0.004, "--samples", 40, "--engine", "exudyn")
    columns = ["time_s", "slider_position_m", "joint_A_force_x_N", "energy_balance_residual_J"]
    table = pd.read_csv(StringIO(run.stdout))[columns]
    given = ("--scene", "ideal-driven", "--from", tmp_path / "mine.csv")
    for off_m, holds in ((0.0, True), (1e-4, False)):
        table.assign(slider_position_m=table["slider_position_m"] + off_m).to_csv(tmp_path / "mine.csv")
        done = crankslider("conform", *given)
        verdicts = {line.split()[1]: line.split()[0] for line in done.stdout.splitlines()}
        assert done.code == (None if holds else 1) or done.code == (0 if holds else 1)
        assert verdicts["slider_position_m:"] == ("holds" if holds else "FAILS")
        assert verdicts["joint_A_force_x_N:"] == "holds"
        assert "energy_balance_residual_J:" not in verdicts


def test_a_study_runs_its_cases_and_no_others(written: Path) -> None:
    done = crankslider("run", "accuracy", "--engine", NAME, "--jobs", 2, "--out", written / "results")
    assert done.code == 0, done.stderr
    with Store(written / "results") as store:
        rows, _ = store.results("accuracy")
    assert {row["engine"] for row in rows} == {NAME}
    ended = {str(row["scene"]): row["status"] for row in rows}
    assert {"ok"} == {status for scene, status in ended.items() if scene in IDEAL_SCENES}
    assert {"unsupported"} == {status for scene, status in ended.items() if scene not in IDEAL_SCENES}


def test_pytest_holds_it_to_the_claims_in_the_users_own_project(written: Path) -> None:
    write(written, off_m=0.099)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--crankslider-engine", NAME]
    done = subprocess.run([*command, "-k", "ideal-free"], cwd=written, capture_output=True, text=True)
    failed = {line for line in done.stdout.splitlines() if line.startswith("FAILED")}
    assert done.returncode == 1, done.stdout + done.stderr
    assert [line for line in failed if "ideal-free" in line] == [*failed], done.stdout
    assert "What the scene observes is where" in done.stdout
    assert "No energy comes or goes" not in done.stdout
