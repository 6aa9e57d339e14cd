"""A run tells its largest contact force, though its samples miss it."""

from dataclasses import replace

import numpy as np
import pytest

import crankslider as cs
from engine_models.engine import Impacts
from tests.helpers.command import crankslider

SCENE = "clearance-driven-0.5mm"


@pytest.fixture(scope="module")
def run() -> cs.Run:
    return cs.simulate(SCENE, end=0.004, samples=50)


IMPACT = (10e3, "B", 0.3)


@pytest.mark.parametrize(
    ("at_samples_N", "largest"),
    [(2.2e3, IMPACT), (11e3, (11e3, "B", 1.0))],
    ids=["between samples", "not ended"],
)
def test_the_largest_force_is_that_of_an_impact_or_a_sample(
    run: cs.Run, at_samples_N: float, largest: tuple[float, str, float]
) -> None:
    """A contact that has not ended has no impact. Of two impacts one has 10 kN at 0.3 s, the other 4 kN."""
    contact = run.trajectory.contacts["B"]
    two = {name: values[:2] for name, values in vars(contact.impacts).items()}
    two |= {"duration_s": np.array([1.0, 0.02]), "largest_normal_force_N": np.array([10e3, 4e3])}
    two |= {"largest_normal_force_time_s": np.array([0.3, 0.7])}
    changed = replace(contact, normal_force_N=np.array([0.0, at_samples_N, 0.0]), impacts=Impacts(**two))
    trajectory = replace(run.trajectory, time_s=np.linspace(0.0, 2.0, 3), contacts={"B": changed})
    told = replace(run, scene=run.scene.replace("end_time_s", 2.0), trajectory=trajectory, by="hand")
    assert told.largest_contact_force == largest
    first = f"the largest contact force is {largest[0] / 1e3:g} kN at joint B at t = {largest[2]:g} s"
    assert told.notes()[1:] == [first]


def test_the_largest_force_is_that_of_a_run_with_many_samples(run: cs.Run) -> None:
    """In 0.2 us, a 260th of the impact, the force has its largest value to 1e-4 at a sample."""
    dense = cs.simulate(SCENE, end=0.004, samples=20_000).frame["contact_B_normal_force_N"]
    largest = run.largest_contact_force
    assert largest is not None
    assert largest.force_N == pytest.approx(dense.max(), rel=1e-4)
    assert largest.time_s == pytest.approx(dense.idxmax(), abs=2e-7)
    assert largest.force_N > 1.5 * run.frame["contact_B_normal_force_N"].max()


def test_a_plot_marks_the_force_that_its_curves_miss(run: cs.Run) -> None:
    forces, largest = run.plot().axes[2], run.largest_contact_force
    assert largest is not None
    mark = next(line for line in forces.lines if str(line.get_label()).startswith("largest contact: 45.9 kN"))
    assert mark.get_xydata().tolist() == [[largest.time_s, largest.force_N]]  # type: ignore[union-attr]
    assert forces.get_ylim()[1] > largest.force_N


def test_after_a_transient_the_largest_force_is_that_of_the_running_machine(run: cs.Run) -> None:
    """Both are told; without a transient the first impact, of the pin that falls, is the largest."""
    late = replace(run, start_s=0.002)
    first, largest = run.largest_contact_force, late.largest_contact_force
    assert first is not None
    assert largest is not None
    impacts = run.impacts[run.impacts["largest_normal_force_time_s"] >= 0.002]
    assert largest.force_N == impacts["largest_normal_force_N"].max() < first.force_N
    (line,) = (line for line in run.notes() if "the largest contact force" in line)
    assert line.endswith(f"{first}, the start counted, which --from TIME leaves out")
    (line,) = (line for line in late.notes() if "the largest contact force" in line)
    assert f"at t = {largest.time_s:.6g} s, after the transient to 0.002 s, in which it is" in line
    assert line.endswith(f"at t = {first.time_s:.6g} s")
    told = crankslider("simulate", SCENE, "--end", "4ms", "--samples", 50, "--from", "2 ms", "--quiet")
    assert (told.code, told.stdout, told.stderr) == (0, "", "")
