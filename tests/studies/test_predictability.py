"""Horizons, exponents and ensembles: known exponents, PHYSICS's horizons, and what the chapter says."""

import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from reports.analysis.ensembles import OWN, PLANTED, QUANTITIES, Ensembles, pairs
from reports.plots.motions import motions
from scipy import stats
from studies.judges.lyapunov import growth
from studies.predictability.cases import EXPONENT, HORIZON, MEMBERS, moves_rad
from studies.predictability.ensemble import WATCH
from studies.predictability.scenes import clearance_driven_lossy, following, period_s, tighter

from engine_models.engine import RunSettings
from engine_models.engines import make_engine
from engine_models.mechanics.contact_law import stiffness_of
from engine_models.scene.library import clearance, clearance_driven_002, clearance_driven_05
from engine_models.scene.scene import Clearances, Scene
from reports.chapters.predictability import CHAPTER, PER_REVOLUTION, motion
from reports.parts import Contradiction, Finding, Studies
from reports.results import read_study, with_columns
from studies.extremes.scenes import GRAVITY_M_S2, wheel
from studies.judges.horizon import apart, first_beyond_s, moved
from studies.predictability import basins, chains, diagrams, study
from studies.running.case import Case, Row
from studies.running.outcome import run_case
from studies.running.runner import run_study
from tests.helpers.row_files import read_rows, write_rows
from tests.studies.truth.closed_forms.crank_slider import slider_position_m

REVOLUTION_S = 0.012
ROOM_M = 5e-4
REFERENCE = make_engine("reference")


# The exponent


def dropped(law: str, height: float) -> Scene:
    """A pin that loses nothing, dropped in its bearing: from the centre at ``height`` 1, the floor at 0."""
    rigid, steel = law == "rigid", stiffness_of(clearance(ROOM_M))
    return wheel(
        "dropped",
        0.2,
        law="rigid" if rigid else "hertz",
        stiffness=None if rigid else steel,
        radial_clearance_m=ROOM_M,
        restitution=1.0 if rigid else None,
        place_m=(0.0, (height - 1) * ROOM_M),
    )


def bounce_s(height: float) -> float:
    """The time from one bounce to the next."""
    return float(2 * np.sqrt(2 * height * ROOM_M / GRAVITY_M_S2))


def known_exponent_per_s(height: float) -> float:
    """Bouncing on the floor of a circle of radius R: x' = x + u T, u' = u - 2 v x'/R with v^2 = 2 g h R.

    The map has determinant 1 and trace 2 - 4 v^2 / (g R) = 2 - 8 h: unstable above h = 1/2, and from the
    centre its multiplier is -(3 + 2 sqrt 2).
    """
    trace = 2 - 8 * height
    multiplier = (abs(trace) + np.sqrt(trace**2 - 4)) / 2 if abs(trace) > 2 else 1.0
    return float(np.log(multiplier)) / bounce_s(height)


#: The direction of the companion has turned by then: its part along the other one falls 34-fold a bounce.
SKIPPED_BOUNCES = 3
#: A contact by Hertz takes 0.65 % of the time between bounces.
TOLERANCES = {"rigid": 1e-4, "hertz": 0.01}


@pytest.mark.parametrize("height", [1.0, 0.75])
@pytest.mark.parametrize("law", ["rigid", "hertz"])
def test_the_exponent_of_a_pin_that_bounces_unstably_is_the_known_one(law: str, height: float) -> None:
    time = bounce_s(height)
    parting = growth(REFERENCE, dropped(law, height), 1e-4, 2 * time, 100)
    exponent, known = parting.exponent_per_s(SKIPPED_BOUNCES * time), known_exponent_per_s(height)
    assert exponent == pytest.approx(known, rel=TOLERANCES[law]), f"{exponent} against {known} 1/s"


def test_a_pin_that_bounces_stably_has_no_positive_exponent() -> None:
    parting = growth(REFERENCE, dropped("rigid", 0.25), 1e-4, 2 * bounce_s(0.25), 100)
    assert parting.exponent_per_s(0.0) < 0.2 * known_exponent_per_s(1.0), "distances only oscillate"


def test_a_scene_that_settles_to_continuous_contact_has_no_exponent() -> None:
    case = next(
        c for c in study.cases(True) if c.columns["part"] == EXPONENT and c.scene.name.endswith("0.02mm")
    )
    row, _ = run_case(case)
    assert row["status"] == "ok"
    assert not [name for name in row if "exponent" in name]
    parting = growth(REFERENCE, case.scene, case.run.step_s, REVOLUTION_S, case.run.samples)
    assert parting.settled
    assert abs(parting.log_growth[-1]) < 2, "and nothing grew"


# The horizon


def visible_after(scene: Scene, size_m: float, tolerance_m: float, revolutions: int) -> float:
    """After how many revolutions a start moved by some m at the crank pin shows in the slider."""
    size = size_m / scene.crank.length_m / 1e-10
    parted = apart(following(scene, revolutions), 100 * revolutions, (-size, size), fine_step_s=1e-5)
    return min(first_beyond_s(parted.time_s, run, tolerance_m) for run in parted.perturbed_m) / REVOLUTION_S


def test_in_set_R_a_change_of_1e_10_m_is_visible_after_two_revolutions() -> None:
    after = visible_after(clearance_driven_05(), 1e-10, 1e-6, 4)
    assert 1.5 < after < 3, f"{after} revolutions"


def test_with_a_restitution_of_a_half_it_takes_seven_to_eight_revolutions() -> None:
    after = visible_after(clearance_driven_lossy(), 1e-11, 1e-4, 9)
    assert 6.5 < after < 8.5, f"{after} revolutions"


def test_nothing_parts_at_a_small_clearance() -> None:
    parted = apart(following(clearance_driven_002(), 4), 400, (-1.0, 1.0))
    assert max(parted.perturbed_m.max(), parted.halved_m.max()) <= 1e-9


def test_the_horizon_grows_with_the_tolerance() -> None:
    parted = apart(following(clearance_driven_05(), 4), 400, (-1.0, 1.0))
    for distance in (*parted.perturbed_m, parted.halved_m):
        times = [first_beyond_s(parted.time_s, distance, tolerance) for tolerance in (1e-10, 1e-9, 1e-6, 1.0)]
        assert times == sorted(times)
        assert times[0] < times[2] < times[3] == np.inf


def test_a_start_that_gives_all_states_cannot_be_moved_by_its_crank_angle() -> None:
    with pytest.raises(ValueError, match="expected a start by crank angle"):
        moved(dropped("rigid", 1.0), 1e-10)


# Members


def test_a_member_in_continuous_contact_has_no_impacts_and_a_deviation_of_one_clearance() -> None:
    known = next(case for case in study.cases(False) if case.columns["part"] == "reference (DOP853)")
    row, curves = study.measure(replace(known, scene=following(clearance_driven_002(), round(WATCH.turns))))
    assert row["revolutions"] == WATCH.revolutions
    assert row["flight_part"] == row["impacts_per_revolution"] == 0
    assert "impact_speed_m_s" not in row
    assert len(curves["impact_phase_rad"]) == 0
    deviation = row["rms_slider_deviation_m"]
    assert isinstance(deviation, float)
    assert 0.5 * 2e-5 < deviation < 1.2 * 2e-5  # penetration is a tenth of this clearance


def test_the_ideal_position_is_that_of_the_assembled_scene() -> None:
    scene = moved(clearance_driven_05(), 0.7)
    run = REFERENCE.simulate(scene.model_copy(update={"end_time_s": 1e-6}), RunSettings(1e-6, 1))
    ideal = slider_position_m(scene, np.array([0.7]))
    assert run.position[:, -1, 0][0] == pytest.approx(ideal[0], abs=1e-15)


def test_every_ensemble_has_starts_of_its_own() -> None:
    members = [case for case in study.cases(True) if "member" in case.columns]
    starts = [(case.scene.name, case.columns["start_moved_rad"]) for case in members]
    assert len({*starts}) == len(members)
    by_part: dict[tuple[str, str], list[float]] = {}
    for case in members:
        key = case.scene.name, str(case.columns["part"])
        by_part.setdefault(key, []).append(float(str(case.columns["start_moved_rad"])))
    assert {len(of_part) for of_part in by_part.values()} == {MEMBERS[True]}
    for of_part in by_part.values():
        assert stats.kstest(of_part, stats.uniform(-np.pi, 2 * np.pi).cdf).pvalue > 1e-4


def test_the_first_of_many_starts_are_the_few() -> None:
    assert moves_rad("an ensemble", 40)[:20] == moves_rad("an ensemble", 20)


def test_a_tighter_scene_differs_in_its_clearances_alone() -> None:
    scene = clearance_driven_05()
    room = scene.clearance.B
    assert room is not None
    wider = room.model_copy(update={"radial_clearance_m": 0.9 * room.radial_clearance_m})
    assert tighter(scene) == scene.model_copy(update={"clearance": Clearances(B=wider)})


# The chapter


def few_columns(case: Case) -> Case:
    """Return a diagram of four columns, each followed for a little."""
    few = {"columns": 4, "in_case": 4, "transient": 4, "revolutions": 6}
    return replace(case, columns={**case.columns, **few, "exponent_every": 3, "exponent_revolutions": 2})


def few_members(case: Case) -> Case:
    """Return a chain of three members, each followed for a little."""
    return replace(case, columns={**case.columns, "columns": 3, "transient": 1, "revolutions": 2})


def few_starts(case: Case) -> Case:
    """Return four starts, each followed for a little."""
    few: Row = {"columns": 2, "in_case": 4, "transient": 1, "revolutions": 2}
    return replace(case, columns={**case.columns, **few})


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A little of every part: two horizons, three starts, small ensembles, a few columns of a diagram."""
    folder = tmp_path_factory.mktemp("results")
    cases = study.cases(True)

    def some(part: str, scene: str, count: int) -> list[Case]:
        of_part = [case for case in cases if case.columns["part"] == part]
        return [case for case in of_part if case.scene.name.endswith(scene)][:count]

    chosen = [
        *some(HORIZON, "driven-A", 1),
        *some(HORIZON, "0.02mm", 1),
        *some(EXPONENT, "driven-A", 2),
        *some(EXPONENT, "0.02mm", 1),
        *some("reference (DOP853)", "0.5mm", 60),
        *some("reference (other starts)", "0.5mm", 60),
        *some("reference (a tenth less clearance)", "0.5mm", 60),
        *some("pymunk (as the scene)", "0.5mm", 4),
        *(few_columns(case) for case in some(diagrams.CLEARANCES, "0.5 mm", 1)),
        *(few_members(case) for case in chains.cases()[:2]),
        *(few_starts(case) for case in basins.cases()[:1]),
    ]
    run_study("predictability", chosen, folder / "predictability", lambda: ThreadPoolExecutor(1))
    return folder


def studies_of(results: Path) -> Studies:
    return {"predictability": read_study(results / "predictability")}


def finding(results: Path, name: str) -> Finding:
    return next(each for each in CHAPTER.findings(studies_of(results)) if each.name == name)


def test_the_chapter_says_what_the_rows_say(results: Path) -> None:
    studies = studies_of(results)
    said = {each.name: each for each in CHAPTER.findings(studies)}
    assert [*said] == ["horizon", "lyapunov-exponents", "ensembles", "diagrams", "reliability"]
    assert "on clearance-driven-0.02mm" in said["horizon"]
    assert "Settles to continuous contact: clearance-driven-0.02mm" in said["lyapunov-exponents"]
    # Two starts: their interval, and so what it says, hangs on round-off.
    assert "clearance-driven-A" in said["lyapunov-exponents"]
    assert said["ensembles"].endswith("too few members: pymunk (as the scene)).")
    names = [f"predictability-{name}" for name in ("growth", "diagram", "ensembles", "maps")]
    figures = [each for each in CHAPTER.figures(studies) if each]
    assert [figure.name for figure in figures] == names
    assert [view.choice[0] for view in figures[1].views] == ["clearance", "crank speed, up and down"]
    tables = {each.name: each for each in CHAPTER.tables(studies) if each}
    alone = ("clearance-driven-0.02mm", "6 revolutions", *["–"] * 6)
    assert alone in tables["predictability-horizons"].rows


def starting(*motions: str) -> pd.DataFrame:
    """Return members of a square grid of starts, its rows one after the other: W at the wall, K knocking."""
    size, turns = len(motions), np.arange(8)
    strobe = {"W": 0 * turns + 1.0, "K": np.random.default_rng(3).uniform(1, 2, 8)}
    return pd.DataFrame(
        {
            "strobe_m": strobe[motions[x][v]],
            "impacts_per_revolution": 0.0 if motions[x][v] == "W" else 5.0,
        }
        for x in range(size)
        for v in range(size)
    )


def test_starts_end_at_the_wall_or_in_impacts_that_do_not_repeat() -> None:
    found = motions(starting("WK", "KW"))
    assert found.tolist() == ["at the wall", *["impacts, not repeating"] * 2, "at the wall"]


def test_a_start_in_a_basin_is_the_run_that_a_user_makes_of_it() -> None:
    case = few_starts(basins.cases()[0])
    row, curves = basins.measure(case)
    assert row["failed_members"] == 0
    place, rate = basins.starts_of(case)
    assert sorted({*place}) == pytest.approx([0.17 - 9e-5, 0.17 + 9e-5])
    assert sorted({*rate}) == [-0.5, 0.5]
    slider = case.plain_scene.start.slider
    assert slider is not None
    begun = slider.model_copy(update={"x_m": float(place[1]), "velocity_x_m_s": float(rate[1])})
    start = case.plain_scene.start.model_copy(update={"slider": begun})
    scene = case.plain_scene.model_copy(update={"start": start})
    turn_s = 2 * np.pi / basins.SPEED_RAD_S
    scene = scene.model_copy(update={"end_time_s": 3 * turn_s})
    run = make_engine("reference", **case.settings).simulate(scene, RunSettings(1.0, 3))
    apart = run.position[:, -1, 0][2:] - slider_position_m(scene, run.position[2:, 0, 2])
    assert curves["strobe_m"].reshape(4, 2)[1] == pytest.approx(apart, abs=1e-9)


def test_the_columns_of_all_stretches_are_those_of_the_diagram_in_order() -> None:
    of_part = [case for case in study.cases(True) if case.columns["part"] == diagrams.SPEEDS]
    of_part = [case for case in of_part if case.columns["columns"] == 100]
    joined = np.concatenate([diagrams.columns_of(case) for case in of_part])
    np.testing.assert_allclose(joined, np.linspace(*diagrams.SPEEDS_RAD_S, 100))


@pytest.mark.parametrize(
    ("whole", "half", "said"),
    [
        ((2.0, 2.1, 2.2), (2.1, 2.0, 1.9), "chaotic"),
        ((-1.0, 0.5, 2.0), (-1.0, 0.5, 2.0), "exponent not told from zero"),
        ((2.0, 2.1, 2.2), (3.0, 3.1, 3.2), "exponent not converged"),
        ((2.0, 2.1, np.nan), (2.0, 2.1, 2.2), "not decided, because starts were not followed to the end"),
    ],
)
def test_chaos_is_a_converged_exponent_whose_interval_is_above_zero(
    whole: tuple[float, ...], half: tuple[float, ...], said: str
) -> None:
    starts = pd.DataFrame({PER_REVOLUTION: whole, f"{PER_REVOLUTION}_half": half, "settled": False})
    assert motion(starts) == said


def test_nothing_is_claimed_where_some_starts_settle() -> None:
    starts = pd.DataFrame({PER_REVOLUTION: (2.0, np.nan), "settled": (False, True)})
    assert motion(starts) == "not decided, because some starts settle"


def ensemble(shift: float, size: int, seed: int) -> pd.DataFrame:
    """Members with two quantities of means 10 and 20 and known scatter; the second is moved by a part."""
    values = stats.zscore(np.random.default_rng(seed).normal(size=(2, size)), axis=1)
    values = 1 + np.array([[0.1], [0.28]]) * values
    speed, impacts = 10 * values[0], 20 * (values[1] + shift)
    table = pd.DataFrame({"impact_speed_m_s": speed, "impacts_per_revolution": impacts})
    return with_columns(table, *QUANTITIES)


def ensembles_with(shift: float, size: int) -> Ensembles:
    """Both ensembles of the reference, one of another mechanism, and that of an engine, of which size is."""
    made = {OWN[0]: (0.0, 200), OWN[1]: (0.0, 200), PLANTED: (0.3, 200), "an engine": (shift, size)}
    return {label: ensemble(*of, seed) for seed, (label, of) in enumerate(made.items(), 1)}


@pytest.mark.parametrize(
    ("shift", "size", "said"),
    [
        (0.0, 800, "equivalent"),
        (0.06, 800, "equivalent"),
        (0.3, 200, "different"),
        (0.06, 200, "undecided"),
        (0.3, 19, "too few members"),
    ],
)
def test_an_engine_is_equivalent_or_different_or_the_members_are_too_few(
    shift: float, size: int, said: str
) -> None:
    *_, pair = pairs(ensembles_with(shift, size))
    assert (pair.label, pair.verdict) == ("an engine", said)


def test_all_members_of_the_control_are_compared_with_and_the_halves_with_each_other() -> None:
    sizes = {pair.label: (pair.twin, pair.sizes) for pair in pairs(ensembles_with(0.0, 60))}
    assert sizes == {
        OWN[1]: (OWN[0], (200, 200)),
        PLANTED: (OWN[0], (200, 400)),
        "an engine": (OWN[0], (60, 400)),
    }


def test_a_verdict_does_not_hang_on_which_half_of_the_control_is_the_first() -> None:
    by_label = ensembles_with(0.05, 200)
    swapped = by_label | {OWN[0]: by_label[OWN[1]], OWN[1]: by_label[OWN[0]]}
    *_, one = pairs(by_label)
    *_, other = pairs(swapped)
    assert np.array(one.differences) == pytest.approx(np.array(other.differences))


def test_a_periodic_scene_whose_repeats_part_contradicts_the_chapter(results: Path, tmp_path: Path) -> None:
    broken = Path(shutil.copytree(results, tmp_path / "results"))
    path = broken / "predictability/rows.jsonl"
    rows = read_rows(path)
    for row in rows:
        if row["part"] == HORIZON and row["scene"] == "clearance-driven-0.02mm":
            row["largest_distance_halved_m"] = 1e-3
    write_rows(path, rows)
    with pytest.raises(Contradiction, match="No distance exceeds"):
        finding(broken, "horizon")


def test_members_have_parted_when_their_averages_begin() -> None:
    scene, members = clearance_driven_05(), 60
    nearest_m = 2 * np.pi / members * scene.crank.length_m
    after = visible_after(scene, nearest_m, 0.1 * ROOM_M, 6)
    assert after < WATCH.transient, f"{after} revolutions until starts have parted"
    assert period_s(scene) == pytest.approx(REVOLUTION_S)
