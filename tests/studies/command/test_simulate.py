"""What ``simulate`` writes and says: which columns, by which method in which steps, and how exact it is."""

from functools import wraps
from shlex import quote, split
from typing import Any, NoReturn

import numpy as np
import pandas as pd
import pytest

from crankslider import library
from engine_models.engines import make_engine
from engine_models.scene.library import SCENES
from reports.look import command
from studies.accuracy import cases
from studies.failures import Failed
from tests.helpers.command import crankslider, table_of
from tests.helpers.ideal_crank_slider import exact

SHORT = ("--end", 0.001, "--samples", 4)


def columns(*words: object) -> set[str]:
    """Return the columns that a call writes."""
    return {*crankslider("simulate", *words, *SHORT).stdout.splitlines()[0].split(",")}


def test_columns_are_absent_that_a_scene_has_no_use_for() -> None:
    free, driven = columns("ideal-free"), columns("ideal-driven")
    assert driven - free == {"driver_torque_N_m"}
    assert free - columns("ideal-free", "--with", "gravity_m_s2=0") == {"potential_energy_J"}
    loaded = {f"slider_{load}_{what}" for load in ("viscous", "gas") for what in ("force_N", "work_J")}
    assert columns("ideal-compressor") - driven == {"driver_work_J", *loaded}
    loose = columns("clearance-driven-0.5mm")
    of_contact = {"clearance_B_x_m", "clearance_B_y_m", "contact_B_penetration_m", "contact_B_normal_force_N"}
    assert loose - driven == {*of_contact, "dissipated_energy_J"}
    assert columns("clearance-driven-damped") - loose == {"contact_B_friction_force_N"}


@pytest.mark.parametrize(("settings", "method"), [([], "dop853"), (["--set", "method=rk4"], "rk4")])
def test_a_tolerance_takes_error_control_unless_the_method_is_set(settings: list[str], method: str) -> None:
    done = crankslider("simulate", "ideal-free", "--tolerance", 1e-9, "--end", 0.1, "--samples", 4, *settings)
    assert (done.code, f" steps of {method}, " in done.stderr) == (0, True)
    true = exact(SCENES["ideal-free"]().replace("end_time_s", 0.1), 4).position[:, -1, 0]
    assert np.abs(table_of(done.stdout)["slider_position_m"] - true).max() < 1e-9


def test_the_note_tells_the_steps_that_were_taken_and_of_chosen_ones_their_mean() -> None:
    short = ("simulate", "ideal-free", "--samples", 3)
    done = crankslider(*short, "--end", 0.01, "--step", 1e-3)
    assert done.stderr.endswith("\nnote: 12 steps of rk4, the longest 0.000833333 s\n")
    done = crankslider(*short, "--end", 0.1, "--set", "method=dop853", "--step", 0.1)
    (note,) = [line for line in done.stderr.splitlines() if " steps of " in line]
    steps, told = note.removeprefix("note: ").split(" steps of dop853, ")
    mean, allowed = told.split(" s on average, ")
    assert float(mean) == pytest.approx(0.1 / int(steps), rel=5e-3)
    assert allowed == "up to 0.1 s allowed"


def test_the_command_of_every_setting_typed_asks_for_that_setting(monkeypatch: pytest.MonkeyPatch) -> None:
    ran = [case for case in cases(full=False) if "view" not in case.columns]
    asked = set()

    @wraps(library.simulate)
    def hear(scene: Any, engine: str, step: str, settings: Any, samples: int, **_: Any) -> NoReturn:
        made = make_engine(engine, **settings)
        asked.add((scene.name, scene.end_time_s, engine, made, float(step), int(samples)))
        raise Failed("heard")

    monkeypatch.setattr(library, "simulate", hear)
    for case in ran:
        given = f"{quote(case.scene.name)} --end {case.scene.end_time_s:.6g}"
        typed = command(pd.Series(case.head()), given)
        assert crankslider(*split(typed)[1:]).stderr == "error: heard\n", typed
    assert asked == {
        (
            case.scene.name,
            case.scene.end_time_s,
            case.engine,
            make_engine(case.engine, **case.settings),
            float(f"{case.head()['step_s']:.10g}"),
            case.run.samples,
        )
        for case in ran
    }
