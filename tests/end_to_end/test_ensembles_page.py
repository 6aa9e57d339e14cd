"""Ensembles beyond the horizon, on rows with round numbers: every cell, sentence and point worked out here.

Members scatter by plus and minus one size, in patterns that are orthogonal from quantity to quantity: so
their variance is n/(n - 1) of its square. In both of the reference's own ensembles together the first
quantity scatters by half the difference of their means besides.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reports.chapters.predictability import CHAPTER
from reports.parts import Contradiction, Finding, Studies, Table
from tests.end_to_end.student import student_quantile
from tests.end_to_end.written_rows import results_of, row

MEMBERS, FEW, TURNS = 32, 16, 4.0
#: A quantity's words, its margin, whether that is a part of the mean, its scatter, and its unit's factor.
QUANTITIES = {
    "impact_speed_m_s": ("impact speed [m/s]", 0.05, True, 0.05, 1.0),
    "rms_slider_deviation_m": ("slider deviation from ideal [mm]", 0.05, True, 2e-5, 1e3),
    "impact_phase_cosine": ("mean cosine of impact phase", 0.1, False, 0.1, 1.0),
}
OWN, LESS, OTHER = "reference (DOP853)", "reference (a tenth less clearance)", "reference (other starts)"
TWIN, EXUDYN, PYMUNK = "reference (twin of pymunk (tuned))", "exudyn (DOPRI5)", "pymunk (tuned)"
SCIPY, ITS_TWIN = "scipy (LSODA)", "reference (twin of scipy (LSODA))"
#: Ensembles in the order of legends: their means, how much less they scatter, and their members.
ENSEMBLES: dict[str, tuple[tuple[float, float, float], float, int]] = {
    OWN: ((1.0, 4e-4, -0.3), 1.0, MEMBERS),
    LESS: ((0.9, 4.02e-4, -0.29), 1.0, MEMBERS),
    OTHER: ((1.03, 4e-4, -0.3), 1.0, MEMBERS),
    TWIN: ((2.0, 5e-4, 0.2), 0.1, MEMBERS),
    ITS_TWIN: ((1.0, 4e-4, -0.3), 1.0, FEW),
    EXUDYN: ((1.001, 3.99e-4, -0.298), 0.5, MEMBERS),
    PYMUNK: ((2.02, 5.01e-4, 0.21), 0.1, MEMBERS),
    SCIPY: ((1.5, 4e-4, -0.3), 1.0, FEW),
}
#: Who is compared with whom, of how many members, and what comes of it.
PAIRS = {
    LESS: (OWN, "32 and 64", "different"),
    OTHER: (OWN, "32 and 32", "undecided"),
    EXUDYN: (OWN, "32 and 64", "equivalent"),
    PYMUNK: (TWIN, "32 and 32", "equivalent"),
    SCIPY: (ITS_TWIN, "16 and 16", "too few members"),
}
SCENE = "clearance-x"


def members(**changed: float) -> list[dict[str, Any]]:
    """Ensembles of one scene; in ``changed`` is another mean impact speed of the one with less clearance."""
    rows: list[dict[str, Any]] = []
    for label, (means, less, count) in ENSEMBLES.items():
        for k in range(count):
            columns: dict[str, Any] = {"part": label, "member": k, "revolutions": TURNS, "end_time_s": 1.0}
            for q, (name, mean) in enumerate(zip(QUANTITIES, means, strict=True)):
                sign = 1 if (k >> q) % 2 else -1
                middle = changed.get(name, mean) if label == LESS else mean
                columns[name] = middle + sign * less * QUANTITIES[name][3]
            columns["impacts_per_revolution"] = 2.0  # does not scatter, and so is not compared
            engine, arm = label.split(" (", 1)
            rows.append(row(len(rows), SCENE, engine, arm[:-1], 1e-5, **columns))
    failed: dict[str, Any] = {"part": "scipy (Radau)", "member": 0, "status": "failed", "reason": "too slow"}
    return [*rows, row(len(rows), SCENE, "scipy", "Radau", 1e-5, **failed, spoken_by="engine")]


@pytest.fixture(scope="module")
def studies(tmp_path_factory: pytest.TempPathFactory) -> Studies:
    folder = tmp_path_factory.mktemp("results") / "predictability"
    return {"predictability": results_of(folder, members(), {})}


def table(studies: Studies, name: str) -> Table:
    return next(each for each in CHAPTER.tables(studies) if each and each.name == f"predictability-{name}")


def finding(studies: Studies, name: str) -> Finding:
    return next(each for each in CHAPTER.findings(studies) if each.name == name)


def test_means_of_ensembles_have_students_interval_over_members(studies: Studies) -> None:
    shown = table(studies, f"means-{SCENE}")
    assert shown.head == ("ensemble", "members", *(words for words, *_ in QUANTITIES.values()))
    expected = []
    for label, (means, less, count) in ENSEMBLES.items():
        cells = []
        for mean, (_, _, _, scatter, factor) in zip(means, QUANTITIES.values(), strict=True):
            half = student_quantile(0.025, count - 1) * less * scatter / math.sqrt(count - 1)
            cells.append(f"{factor * mean:.3g} ± {factor * half:.1g}")
        expected.append((label, str(count), *cells))
    assert list(shown.rows) == expected


#: A mean, the square of its uncertainty, and the degrees of freedom of that.
Mean = tuple[float, float, int]


def ensemble(label: str) -> list[Mean]:
    """Return the means of an ensemble's quantities."""
    means, less, count = ENSEMBLES[label]
    scatters = (scatter for _, _, _, scatter, _ in QUANTITIES.values())
    return [
        (mean, (less * of) ** 2 / (count - 1), count - 1) for mean, of in zip(means, scatters, strict=True)
    ]


def control() -> list[Mean]:
    """Return the means of both of the reference's own ensembles together."""
    out, count = [], 2 * MEMBERS
    for one, other, (_, _, _, scatter, _) in zip(
        ENSEMBLES[OWN][0], ENSEMBLES[OTHER][0], QUANTITIES.values(), strict=True
    ):
        square = (scatter**2 + ((other - one) / 2) ** 2) / (count - 1)
        out.append(((one + other) / 2, square, count - 1))
    return out


def of_twin(label: str) -> list[Mean]:
    """Return the means of what an ensemble is compared with."""
    return control() if label in (LESS, EXUDYN) else ensemble(PAIRS[label][0])


def in_margins(one: Mean, other: Mean, margin: float, is_part: bool) -> tuple[float, float, float]:
    """Return a difference and the ends of its interval in margins; those of a ratio by bisection."""
    (mean, a, free), (elsewhere, b, freely) = one, other
    t = student_quantile(0.04, (a + b) ** 2 / (a**2 / free + b**2 / freely))
    if not is_part:
        off, half = mean - elsewhere, t * math.sqrt(a + b)
        return off / margin, (off - half) / margin, (off + half) / margin
    ends = []
    for sign in (-1, 1):
        near, far = mean / elsewhere, mean / elsewhere + sign
        for _ in range(60):
            middle = (near + far) / 2
            within = abs(mean - middle * elsewhere) < t * math.sqrt(a + middle**2 * b)
            near, far = (middle, far) if within else (near, middle)
        ends.append((near - 1) / margin)
    return (mean / elsewhere - 1) / margin, ends[0], ends[1]


def compared(label: str) -> list[tuple[float, float, float]]:
    """Return the differences of an ensemble's quantities in margins, with the ends of their intervals."""
    both = zip(ensemble(label), of_twin(label), QUANTITIES.values(), strict=True)
    return [in_margins(one, other, margin, is_part) for one, other, (_, margin, is_part, _, _) in both]


def test_every_quantity_of_every_pair_is_compared(studies: Studies) -> None:
    shown, expected = table(studies, f"tests-{SCENE}"), []
    assert shown.head == (
        *("ensemble", "compared with", "members", "quantity", "margin", "difference", "verdict"),
    )
    for label, (twin, sizes, verdict) in PAIRS.items():
        for ends, (words, margin, is_part, _, _) in zip(compared(label), QUANTITIES.values(), strict=True):
            unit, whole = (" %", 100 * margin) if is_part else ("", margin)
            off, low, high = (f"{whole * end:+.3g}{unit}" for end in ends)
            cell = "–" if verdict == "too few members" else f"{off} ({low} to {high})"
            expected.append((label, twin, sizes, words, f"{whole:g}{unit}", cell, verdict))
    assert list(shown.rows) == expected


def test_a_verdict_follows_from_all_intervals_of_an_ensemble() -> None:
    """The expected verdicts of this file by the rule in words."""
    for label, (_, _, verdict) in PAIRS.items():
        if verdict != "too few members":
            ends = compared(label)
            within = all(low > -1 and high < 1 for _, low, high in ends)
            beyond = any(low > 1 or high < -1 for _, low, high in ends)
            assert verdict == ("equivalent" if within else "different" if beyond else "undecided"), label


def test_the_verdicts_are_told_in_one_sentence(studies: Studies) -> None:
    told = finding(studies, "ensembles")
    assert told == (
        f"2 of 5 ensembles on {SCENE} are equivalent to the reference implementation's by two "
        f"one-sided tests (equivalent: {EXUDYN} and {PYMUNK}; different: {LESS}; undecided: {OTHER}; too few "
        f"members: {SCIPY})."
    )
    assert [number.value for number in told.numbers] == [2, 5]


def test_a_tenth_less_clearance_that_comes_out_equivalent_contradicts_the_chapter(
    tmp_path: Path,
) -> None:
    blind = members(impact_speed_m_s=1.015)
    results = results_of(tmp_path / "predictability", blind, {})
    with pytest.raises(Contradiction, match="a tenth less clearance"):
        finding({"predictability": results}, "ensembles")


def test_differences_are_drawn_in_units_of_the_margin(studies: Studies) -> None:
    (figure,) = CHAPTER.figures(studies)
    assert figure
    ((choice, drawing),) = figure.views
    assert (figure.name, choice) == ("predictability-ensembles", (SCENE,))
    for panel, (label, (_, _, verdict)) in zip(drawing.axes, PAIRS.items(), strict=True):
        assert (panel.get_title(), panel.get_xlabel()) == (f"{label}:\n{verdict}", "difference / margin")
        if verdict == "too few members":
            assert not panel.lines
            continue
        (dots,), (bars,) = panel.lines, panel.collections
        off, low, high = np.clip(np.transpose(compared(label)), -4, 4)
        assert np.asarray(dots.get_xydata()) == pytest.approx(np.transpose([off, [0, 1, 2]]))
        ends = [segment[:, 0].tolist() for segment in bars.get_segments()]  # type: ignore[attr-defined]
        assert np.array(ends) == pytest.approx(np.transpose([low, high]))
    names = [text.get_text() for text in drawing.axes[0].get_yticklabels()]
    assert names == ["impact speed", "slider deviation from ideal", "mean cosine of impact phase"]


def test_what_did_not_finish_is_listed_with_its_reason(studies: Studies) -> None:
    shown = table(studies, "failures")
    assert shown.head == (
        "scene",
        "engine",
        "configuration",
        "step [s]",
        "status",
        "reason given by",
        "reason",
    )
    assert shown.rows == ((SCENE, "scipy", "scipy (Radau)", "1.0e-05", "failed", "the engine", "too slow"),)
    told = finding(studies, "reliability")
    assert told.startswith("224 of 225 runs finished; reasons for the others were given by: the engine 1")
