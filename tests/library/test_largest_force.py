"""A run tells its largest contact force, though its samples miss it."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import crankslider as cs
from tests.helpers.command import crankslider

SCENE = "clearance-driven-0.5mm"
RIGID = {"law": "rigid", "young_modulus_Pa": None, "poisson_ratio": None}


@pytest.fixture(scope="module")
def run() -> cs.Run:
    return cs.simulate(SCENE, end=0.004, samples=50)


def with_force(run: cs.Run, at_samples_N: Sequence[float], **of_impacts: Sequence[float]) -> cs.Run:
    """Return a run of 2 s with other normal forces at B, at samples and of impacts."""
    contact = run.trajectory.contacts["B"]
    few = {name: values[: len(of_impacts["duration_s"])] for name, values in vars(contact.impacts).items()}
    changed = replace(
        contact,
        normal_force_N=np.array(at_samples_N),
        impacts=replace(contact.impacts, **few | {name: np.array(x) for name, x in of_impacts.items()}),
    )
    times = np.linspace(0.0, 2.0, len(at_samples_N))
    trajectory = replace(run.trajectory, time_s=times, contacts={"B": changed})
    return replace(run, scene=run.scene.replace("end_time_s", 2.0), trajectory=trajectory)


def hit(run: cs.Run, at_samples_N: Sequence[float], duration_s: float) -> cs.Run:
    """Return a run with an impact of 10 kN at 0.3 s and one of 4 kN, which is the shorter one."""
    return with_force(
        run,
        at_samples_N,
        duration_s=[1.0, duration_s],
        largest_normal_force_N=[10e3, 4e3],
        largest_normal_force_time_s=[0.3, 0.7],
    )


IMPACT = (10e3, "B", 0.3)
ADVICE = "--impacts FILE has every impact's largest"


@pytest.mark.parametrize(
    ("at_samples_N", "duration_s", "largest", "missed"),
    [
        (2.2e3, 0.02, IMPACT, f"at most 2.2 kN of it: {ADVICE}, --samples 1000 resolves them"),
        (9.01e3, 0.02, IMPACT, None),
        (8.99e3, 0.02, IMPACT, f"at most 8.99 kN of it: {ADVICE}, --samples 1000 resolves them"),
        (0.0, 2e-4, IMPACT, f"at most 0 N of it: {ADVICE}, --samples 100000 resolves them"),
        (0.0, 1.9e-4, IMPACT, f"at most 0 N of it: {ADVICE}"),
        (11e3, 0.02, (11e3, "B", 1.0), None),
    ],
    ids=["between samples", "nine tenths", "less", "most samples", "more than there can be", "not ended"],
)
def test_the_largest_force_is_that_of_an_impact_or_a_sample_and_samples_that_miss_it_are_told(
    run: cs.Run, at_samples_N: float, duration_s: float, largest: tuple[float, str, float], missed: str | None
) -> None:
    """Nine tenths are enough; a contact that has not ended has no impact; no more than 100000 are advised."""
    told = hit(run, [0.0, at_samples_N, 0.0], duration_s)
    assert told.largest_contact_force == largest
    first = f"the largest contact force is {largest[0] / 1e3:g} kN at joint B at t = {largest[2]:g} s"
    assert told._notes_of_force() == [first, *([f"2 samples show {missed}"] if missed else [])]


def test_the_largest_force_is_that_of_a_run_with_many_samples(run: cs.Run) -> None:
    """In 0.2 us, a 260th of the impact, the force has its largest value to 1e-4 at a sample."""
    dense = cs.simulate(SCENE, end=0.004, samples=20_000).frame["contact_B_normal_force_N"]
    largest = run.largest_contact_force
    assert largest is not None
    assert largest.force_N == pytest.approx(dense.max(), rel=1e-4)
    assert largest.time_s == pytest.approx(dense.idxmax(), abs=2e-7)
    assert largest.force_N > 1.5 * run.frame["contact_B_normal_force_N"].max()


def test_as_many_samples_as_are_advised_show_the_force(run: cs.Run) -> None:
    done = crankslider("simulate", SCENE, "--end", 0.004, "--samples", 50)
    said = [line.removeprefix("note: ") for line in done.stderr.splitlines()]
    assert said == run.notes()
    (advised,) = re.findall(r"--samples (\d+) resolves them$", done.stderr)
    finer = cs.simulate(SCENE, end=0.004, samples=int(advised))
    assert finer.notes()[2:] == run.notes()[2:3]
    shortest = cs.simulate(SCENE, end=0.004, samples=50).impacts["duration_s"].min()
    assert 9.5 <= shortest / (0.004 / int(advised)) <= 10.5


def test_a_plot_marks_the_force_that_its_curves_miss(run: cs.Run) -> None:
    forces, largest = run.plot().axes[2], run.largest_contact_force
    assert largest is not None
    mark = next(line for line in forces.lines if line.get_label() == "_mark")
    assert mark.get_xydata().tolist() == [[largest.time_s, largest.force_N]]  # type: ignore[union-attr]
    assert forces.get_ylim()[1] > largest.force_N
    assert [text.get_text() for text in forces.texts] == ["largest contact: 45.9 kN at B"]


def test_beside_a_rigid_wall_the_other_joint_has_a_largest_force(tmp_path: Path) -> None:
    both = cs.scenes["clearance-driven-AB"]
    mixed = both.replace({f"clearance.A.{name}": value for name, value in RIGID.items()})
    run = cs.simulate(mixed, end=0.002, samples=20)
    assert run.largest_contact_force is not None
    assert run.largest_contact_force.joint == "B"
    (tmp_path / "mixed.toml").write_text(mixed.to_toml())
    written = ("simulate", tmp_path / "mixed.toml", "--samples", 20, "--impacts", tmp_path / "i.json")
    assert crankslider(*written, "--end", 0.002).code == 0
    columns = json.loads((tmp_path / "i.json").read_text())["columns"]
    without = [depth is None for depth in columns["largest_penetration_m"]]
    assert without == [joint == "A" for joint in columns["joint"]]
    assert 0 < sum(without) < len(without)


def test_after_a_transient_the_largest_force_is_that_of_the_running_machine(run: cs.Run) -> None:
    """Both are told; without a transient the first impact, of the pin that falls, is the largest."""
    late = replace(run, start_s=0.002)
    first, largest = run.largest_contact_force, late.largest_contact_force
    assert first is not None
    assert largest is not None
    impacts = run.impacts[run.impacts["largest_normal_force_time_s"] >= 0.002]
    assert largest.force_N == impacts["largest_normal_force_N"].max() < first.force_N
    (line,) = (line for line in late.notes() if "the largest contact force" in line)
    assert f"at t = {largest.time_s:.6g} s, after the transient to 0.002 s, in which it is" in line
    assert line.endswith(f"at t = {first.time_s:.6g} s")
    told = crankslider("simulate", SCENE, "--end", "4ms", "--samples", 50, "--from", "2 ms", "--quiet")
    assert (told.code, told.stdout, told.stderr) == (0, "", "")
