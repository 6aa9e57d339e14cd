"""The gate itself: what is no baseline, out of its band, gone or without a reason is refused, and told."""

from dataclasses import fields, replace
from pathlib import Path

import pytest

from engine_models import arms
from engine_models.arms import Arm
from studies.conformance.baselines import accept, subjects
from studies.conformance.baselines.accept import PROCESSORS, accepted
from studies.conformance.baselines.bands import band
from studies.conformance.baselines.measured import Key, NotMeasured, Number, measured, orders
from studies.conformance.baselines.subjects import Subject
from studies.conformance.baselines.table import Baseline, DamagedTable, read_tables, write_tables
from studies.conformance.baselines.verdicts import verdict, verdicts
from studies.running.case import Row
from tests.helpers.command import crankslider

KEY = Key("agreement", "ideal-free", "reference (none)", "step 1 s", "slider_position_error_m")
NUMBER = Number(1e-6, "m", "a truth", known_to=1e-15)
#: 8e-7 to 1.25e-6, as somebody has written it.
BASELINE = Baseline(1e-6, 8e-7, 1.25e-6, "m", 1e-9, "a truth", "measured")


def valued(value: float) -> Number:
    return replace(NUMBER, value=value)


@pytest.mark.parametrize(
    ("value", "became"), [(8e-7, ""), (1.25e-6, ""), (1.26e-6, " is worse: "), (7.9e-7, " is better: ")]
)
def test_a_number_passes_within_its_band_and_fails_beyond_either_end(value: float, became: str) -> None:
    line = verdict(KEY, valued(value), BASELINE)
    assert (became in line) if became else line == ""
    assert not line or "expected 8e-07 to 1.25e-06 m" in line


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_no_number_at_all_is_out_of_every_band(value: float) -> None:
    assert verdict(KEY, valued(value), BASELINE)


def test_a_number_without_a_baseline_and_a_baseline_without_its_number_fail() -> None:
    other = KEY._replace(quantity="steps")
    assert "got none for 1e-06" in verdicts({KEY: NUMBER}, {})[0]
    assert "got no such number" in verdicts({KEY: NUMBER}, {KEY: BASELINE, other: BASELINE})[0]


@pytest.mark.parametrize(
    ("quantity", "number", "others", "seen", "unseen"),
    [
        # An error by truncation: half again as large, or a third less, is another result.
        ("slider_position_error_m", NUMBER, [1e-6], (1.5e-6, 6.6e-7), (1.2e-6, 8e-7)),
        # What processors move by 10 % has a band of 50 %.
        ("slider_position_error_m", NUMBER, [1e-6, 1.1e-6], (1.6e-6, 4e-7), (1.49e-6, 5.1e-7)),
        # An error of the truth's own size has nothing to keep but that size.
        ("slider_position_error_m", Number(2e-15, "m", "", known_to=1e-15), [], (8e-15,), (0.0, 6e-15)),
        ("steps", Number(1000, "1", "", count=True), [1000], (1101, 899), (1099, 901)),
        ("impacts_missed", Number(0, "1", "", count=True), [0], (1,), (0,)),
        ("slider_position_order", Number(4.0, "1", ""), [4.0], (4.11, 3.89), (4.09, 3.91)),
        ("slider_position_uncertainty_m", Number(1e-9, "m", ""), [2e-9], (2.1e-8, 9e-11, 0.0), (1e-8, 2e-10)),
        ("slider_position_cross_check_m", Number(1e-9, "m", ""), [2e-9], (2.1e-8, 9e-11, 0.0), (1e-8, 2e-10)),
    ],
)
def test_a_band_shows_another_result_and_not_another_processor(
    quantity: str, number: Number, others: list[float], seen: tuple[float, ...], unseen: tuple[float, ...]
) -> None:
    found = band(quantity, number, others)
    assert not [value for value in seen if found.low <= value <= found.high]
    assert not [value for value in unseen if not found.low <= value <= found.high]


@pytest.mark.parametrize(
    ("errors", "known_to", "found"),
    [
        ((1.6e-3, 3.2e-4, 1e-4), 1e-15, {"x_order": 4.0}),
        ((1.6e-3, 7.2e-4, 4e-4), 1e-15, {"x_order": 2.0}),
        ((2e-15, 1.4e-15, 1e-15), 1e-15, {}),  # the truth is known no better
        ((1e-9, 1.5e-9, 2.8e-9), 1e-15, {}),  # a run's own round-off, which plain slopes take for -1.49
        ((4e-9, 1.9e-9, 1.6e-9), 1e-15, {}),  # it falls no further, and a plain slope is 1.3
        ((94.0, 93.0, 92.0), 1e-15, {}),
    ],
)
def test_an_order_is_the_slope_between_two_steps_where_the_step_between_shows_it_too(
    errors: tuple[float, float, float], known_to: float, found: dict[str, float]
) -> None:
    rows: list[Row] = [
        {"steps": steps, "x_error_m": error, "x_uncertainty_m": known_to}
        for steps, error in zip((100, 150, 200), errors, strict=True)
    ]
    assert orders(rows) == pytest.approx(found, abs=0.01)


def test_an_order_may_appear_and_may_not_vanish() -> None:
    order = KEY._replace(quantity="slider_position_order")
    assert verdicts({order: NUMBER}, {}) == []
    assert "got no such number" in verdicts({}, {order: BASELINE})[0]


def test_every_arm_of_the_catalogue_has_baselines() -> None:
    catalogue = {arm.label for arm in vars(arms).values() if isinstance(arm, Arm)}
    assert catalogue == {key.arm for key in read_tables()}


def test_a_subject_is_measured_as_its_study_measures_it() -> None:
    (subject,) = (
        s for s in subjects.subjects() if s.key == ("agreement", "ideal-driven", "reference (none)")
    )
    numbers = {key.quantity: number.value for key, number in measured(subject).items()}
    assert numbers["slider_position_order"] == pytest.approx(4.0, abs=0.05)
    assert numbers["steps"] == 32 * 200


def test_a_run_that_fails_is_no_number() -> None:
    (subject,) = (
        s for s in subjects.subjects() if s.key == ("agreement", "ideal-driven", "reference (none)")
    )
    arm = Arm("pymunk", "1 sweep", {"joints": "all", "iterations": 1})
    failing = replace(subject.cases[0], arm=arm, added={})
    with pytest.raises(NotMeasured, match=r"pymunk \(1 sweep\) on ideal-driven .* 'failed: "):
        measured(Subject((failing,)))


def test_acceptance_renews_what_left_its_band_alone_and_drops_what_is_gone() -> None:
    subject = subjects.subjects()[0]
    kept, left, gone = (
        Key(*subject.key, "step 1 s", name) for name in ("a_error_m", "b_error_m", "c_error_m")
    )
    before = {kept: BASELINE, left: BASELINE, gone: BASELINE}
    asked = []

    def measure(some: object, processor: object) -> accept.Numbers:
        asked.append((some, processor))
        return {kept: valued(1.1e-6), left: valued(2.1e-6)}

    after = accepted({kept: valued(1.1e-6), left: valued(2e-6)}, before, [subject], "a reason", measure)
    assert asked == [([subject], processor) for processor in PROCESSORS]
    assert after[kept] == BASELINE
    assert (after[left].value, after[left].why) == (2e-6, "a reason")
    assert after[left].moved == pytest.approx(1e-7)
    assert gone not in after


def test_tables_come_back_as_they_were_written_and_damage_is_named(tmp_path: Path) -> None:
    write_tables({KEY: BASELINE}, tmp_path)
    assert read_tables(tmp_path) == {KEY: BASELINE}
    path = tmp_path / "agreement.csv"
    whole = path.read_text(encoding="utf-8")
    for damage in (
        whole.replace("8e-07", "eight"),
        whole.replace("8e-07", "2e-06"),
        whole + whole.splitlines()[1],
    ):
        path.write_text(damage, encoding="utf-8")
        with pytest.raises(DamagedTable, match=r"agreement\.csv:[23]: expected "):
            read_tables(tmp_path)


def test_every_baseline_says_why_and_what_its_truth_is() -> None:
    tables = read_tables()
    assert tables
    assert all(getattr(one, field.name) != "" for one in tables.values() for field in fields(Baseline))


@pytest.mark.parametrize("arguments", [["--accept"], ["--accept", "--why", " "], ["--why", "a reason"]])
def test_acceptance_and_its_reason_belong_together(arguments: list[str]) -> None:
    done = crankslider("baseline", *arguments)
    assert (done.code, done.stdout) == (2, "")
    assert done.stderr.startswith("error: --why: expected a reason with --accept, got ")
