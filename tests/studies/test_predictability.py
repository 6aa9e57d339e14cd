"""Horizons, exponents and ensembles: known exponents, PHYSICS's horizons, and tests that keep their level."""

import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from engine_models.engine import FloatArray, RunSettings
from engine_models.engines import make_engine
from engine_models.mechanics.contact_law import stiffness_of
from engine_models.scene.library import clearance, clearance_driven_002, clearance_driven_05
from engine_models.scene.scene import Scene
from reports import page
from reports.chapters import predictability
from reports.chapters.predictability import findings, statistics
from reports.chapters.predictability.data import PER_REVOLUTION
from reports.parts import Contradiction
from studies.extremes.scenes import GRAVITY_M_S2, wheel
from studies.judges.horizon import apart, first_beyond_s, moved
from studies.judges.ideal_truth import slider_position_m
from studies.judges.lyapunov import growth
from studies.predictability import study
from studies.predictability.cases import ENSEMBLE_REVOLUTIONS, EXPONENT, HORIZON, MOVES_RAD, moves_rad
from studies.predictability.ensemble import period_s
from studies.predictability.ensemble import statistics as member_statistics
from studies.predictability.scenes import clearance_driven_lossy, following
from studies.running.case import Case
from studies.running.outcome import run_case
from studies.running.runner import run_study
from tests.helpers.row_files import read_rows, write_rows

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
        c for c in study.cases(False) if c.columns["part"] == EXPONENT and c.scene.name.endswith("0.02mm")
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
    scene = following(clearance_driven_002(), 3)
    run = REFERENCE.simulate(scene, RunSettings(1e-5, 300))
    row, curves = member_statistics(scene, run, 2 * REVOLUTION_S)
    assert row["revolutions"] == pytest.approx(1)
    assert row["free_flight_fraction"] == 0
    assert row["impacts_per_revolution"] == 0
    assert "impact_speed_m_s" not in row
    assert len(curves["impact_phase_rad"]) == 0
    assert isinstance(row["slider_deviation_m"], float)
    assert 0.5 * 2e-5 < row["slider_deviation_m"] < 1.2 * 2e-5  # penetration is a tenth of this clearance


def test_the_ideal_position_is_that_of_the_assembled_scene() -> None:
    scene = moved(clearance_driven_05(), 0.7)
    run = REFERENCE.simulate(scene.model_copy(update={"end_time_s": 1e-6}), RunSettings(1e-6, 1))
    ideal = slider_position_m(scene, np.array([0.7]))
    assert run.slider_position_m[0] == pytest.approx(ideal[0], abs=1e-15)


def test_starts_are_distinct_within_their_sizes_and_the_few_begin_the_many() -> None:
    few, many, others = moves_rad(20), moves_rad(40), moves_rad(40, mirrored=True)
    assert many[:20] == few
    assert len({*many, *others}) == 80
    sizes = np.abs([*many, *others])
    assert MOVES_RAD[0] <= sizes.min()
    assert sizes.max() <= MOVES_RAD[1]
    assert min(np.sum(np.array(few) > 0), np.sum(np.array(few) < 0)) == 10


# Tests that keep their level


def samples(kind: str, rng: np.random.Generator, size: int) -> FloatArray:
    return rng.normal(size=(size, 1)) if kind == "normal" else rng.exponential(size=(size, 1))


TRIALS = 600


@pytest.mark.parametrize("kind", ["normal", "exponential"])
def test_the_permutation_test_sounds_false_alarms_at_its_nominal_rate(kind: str) -> None:
    rng = np.random.default_rng(1)
    alarms = sum(
        float(statistics.permutation_p(samples(kind, rng, 20), samples(kind, rng, 20))[0]) <= statistics.LEVEL
        for _ in range(TRIALS)
    )
    low, high = statistics.Rate(alarms, TRIALS).interval
    assert low <= statistics.LEVEL <= high, f"{alarms} of {TRIALS}"


def test_the_test_of_shape_is_no_more_alarming_than_its_level() -> None:
    rng = np.random.default_rng(2)
    p = [
        float(statistics.kolmogorov_smirnov_p(samples("normal", rng, 20), samples("normal", rng, 20))[0])
        for _ in range(TRIALS)
    ]
    low, _ = statistics.Rate(int(np.sum(np.array(p) <= statistics.LEVEL)), TRIALS).interval
    assert low <= statistics.LEVEL


def test_false_alarms_counted_within_a_pool_are_at_the_nominal_rate() -> None:
    pool = np.random.default_rng(3).exponential(size=(60, 2))
    by_means, by_any = statistics.false_alarms(pool, 20, 300)
    for rate in by_means:
        assert rate.interval[0] <= statistics.LEVEL <= rate.interval[1], rate
    assert all(rate.value <= 0.1 for rate in by_any)


def test_a_shift_of_the_size_called_detectable_is_detected_four_times_of_five() -> None:
    rng = np.random.default_rng(4)
    shift = statistics.detectable_difference(rng.normal(size=100_000), 20)
    detected = sum(
        float(statistics.permutation_p(samples("normal", rng, 20) + shift, samples("normal", rng, 20))[0])
        <= statistics.LEVEL
        for _ in range(TRIALS)
    )
    low, high = statistics.Rate(detected, TRIALS).interval
    # Samples of twenty estimate their own spread, which costs a normal test two or three hundredths.
    assert low - 0.03 < 0.8 < high + 0.03, f"{detected} of {TRIALS}"


def test_a_bootstrap_interval_covers_the_mean_nearly_as_often_as_it_says() -> None:
    rng = np.random.default_rng(5)
    inside = 0
    for _ in range(300):
        interval = statistics.mean_interval(samples("normal", rng, 20)[:, 0])
        inside += interval.low <= 0 <= interval.high
    assert statistics.Rate(inside, 300).interval[1] > 0.9, f"{inside} of 300"


def test_holms_correction_is_the_textbooks() -> None:
    corrected = statistics.holm(np.array([0.01, 0.04, 0.03, 0.005]))
    assert corrected == pytest.approx([0.03, 0.06, 0.06, 0.02])


# The chapter


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A little of every part: two horizons, three starts, small ensembles, a few points of a picture."""
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
        *(
            case
            for part in ("reference (scene's law)", "reference (other starts)")
            for case in some(part, "", 8)
        ),
        *some("pymunk (as the scene)", "", 4),
        *some("against clearance", "", len(cases))[::48],
    ]
    run_study("predictability", chosen, folder / "predictability", lambda: ThreadPoolExecutor(1))
    return folder


def built(results: Path, out: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(page, "STUDIES", (predictability,))
    page.write_report(results, out)
    return (out / "index.html").read_text("utf-8")


def test_the_chapter_says_what_the_rows_say(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = built(results, tmp_path / "report", monkeypatch)
    assert "Nothing parts on clearance-driven-0.02mm" in text
    assert "No exponent is given where every start settles" in text
    # Two starts: their interval, and so what it says, hangs on round-off.
    assert "On clearance-driven-A distances grow" in text
    assert "permutation test tells the reference from itself" in text
    assert len(list((tmp_path / "report/figures").glob("*.png"))) == 5
    table = (tmp_path / "report/tables/predictability-horizons.csv").read_text("utf-8")
    assert "clearance-driven-0.02mm,6 revolutions,–,–,–,–,–,–" in table


@pytest.mark.parametrize(
    ("exponents", "said"),
    [((2.0, 2.1, 2.2), "which is chaos"), ((-1.0, 0.5, 2.0), "which these starts do not tell from zero")],
)
def test_chaos_is_an_exponent_whose_interval_is_above_zero(exponents: tuple[float, ...], said: str) -> None:
    starts = pd.DataFrame({PER_REVOLUTION: exponents})
    (sentence,) = findings.exponents({"a scene": starts})
    assert said in sentence


def test_a_periodic_scene_whose_repeats_part_contradicts_the_chapter(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = Path(shutil.copytree(results, tmp_path / "results"))
    path = broken / "predictability/rows.jsonl"
    rows = read_rows(path)
    for row in rows:
        if row["part"] == HORIZON and row["scene"] == "clearance-driven-0.02mm":
            row["largest_distance_halved_m"] = 1e-3
    write_rows(path, rows)
    with pytest.raises(Contradiction, match="Nothing parts"):
        built(broken, tmp_path / "report", monkeypatch)


def test_ensembles_begin_after_the_horizon_of_their_starts() -> None:
    scene = clearance_driven_05()
    smallest_m = MOVES_RAD[0] * scene.crank.length_m
    after = visible_after(scene, smallest_m, 0.1 * ROOM_M, 6)
    assert after < ENSEMBLE_REVOLUTIONS[0], f"{after} revolutions until starts have parted"
    assert period_s(scene) == pytest.approx(REVOLUTION_S)
