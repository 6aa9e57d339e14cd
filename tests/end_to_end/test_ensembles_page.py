"""Ensembles past the horizon, on rows with round numbers: every cell, sentence and point worked out here.

Members scatter by plus and minus one size, in patterns that are orthogonal from quantity to quantity: so
their variance is 24/23 of its square, and Hotelling's distance is the sum of the squares of Welch's.
"""

import math
from typing import Any

import numpy as np
import pytest

from reports.chapters import predictability
from reports.parts import Figure, Section, Table
from tests.end_to_end.student import fisher_tail, student_quantile, student_tail
from tests.end_to_end.written_rows import results_of, row

MEMBERS, TURNS = 24, 4.0
#: A quantity's words, its margin, whether that is a part of the mean, its scatter, and its unit's factor.
QUANTITIES = {
    "impact_speed_m_s": ("impact speed [m/s]", 0.05, True, 0.05, 1.0),
    "rms_slider_deviation_m": ("slider deviation from ideal [mm]", 0.05, True, 2e-5, 1e3),
    "impact_phase_cosine": ("mean cosine of impact phase", 0.1, False, 0.1, 1.0),
}
OWN, LESS, OTHER = "reference (DOP853)", "reference (a tenth less clearance)", "reference (other starts)"
TWIN, EXUDYN, PYMUNK = "reference (twin of pymunk (tuned))", "exudyn (DOPRI5)", "pymunk (tuned)"
#: Ensembles in the order of legends: their means, and how much less they scatter.
ENSEMBLES: dict[str, tuple[tuple[float, float, float], float]] = {
    OWN: ((1.0, 4e-4, -0.3), 1.0),
    LESS: ((0.9, 4.02e-4, -0.29), 1.0),
    OTHER: ((1.03, 4.01e-4, -0.3), 1.0),
    TWIN: ((2.0, 5e-4, 0.2), 0.1),
    EXUDYN: ((1.001, 3.99e-4, -0.298), 1.0),
    PYMUNK: ((2.02, 5.01e-4, 0.21), 0.1),
}
#: Who is compared with whom, and what comes of it.
PAIRS = {
    LESS: (OWN, "different", "1", "2"),
    OTHER: (OWN, "open", "0", "2"),
    EXUDYN: (OWN, "equivalent", "0", "3"),
    PYMUNK: (TWIN, "equivalent, yet told apart", "2", "3"),
}
SCENE = "clearance-x"


def members() -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Ensembles of one scene: half of the members have 6 impacts at 45°, others 10, and Pymunk's at 195°."""
    rows: list[dict[str, Any]] = []
    curves = {}
    for label, (means, less) in ENSEMBLES.items():
        for k in range(MEMBERS):
            columns: dict[str, Any] = {"part": label, "member": k, "revolutions": TURNS}
            for q, (name, mean) in enumerate(zip(QUANTITIES, means, strict=True)):
                sign = 1 if (k >> q) % 2 else -1
                columns[name] = mean + sign * less * QUANTITIES[name][3]
            columns["impacts_per_revolution"] = 2.0  # does not scatter, and so is not compared
            engine, arm = label.split(" (", 1)
            rows.append(row(len(rows), SCENE, engine, arm[:-1], 1e-5, end_time_s=1.0, **columns))
            angle = math.radians(195.0 if label == PYMUNK else 45.0)
            curves[rows[-1]["case"]] = {"impact_phase_rad": [angle] * (6 if k % 2 else 10)}
    return rows, curves


@pytest.fixture(scope="module")
def sections(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Section]:
    rows, curves = members()
    rows.append(
        row(len(rows), SCENE, "scipy", "LSODA", 1e-5, part="scipy (LSODA)", member=0, status="failed")
    )
    rows[-1] |= {"reason": "too slow", "spoken_by": "engine"}
    results = results_of(tmp_path_factory.mktemp("results") / "predictability", rows, curves)
    return {section.name: section for section in predictability.sections(results)}


def table(sections: dict[str, Section], name: str) -> Table:
    found = (one for section in sections.values() for one in section.tables)
    return next(one for one in found if one.name == f"predictability-{name}")


def figure(sections: dict[str, Section], name: str) -> Figure:
    found = (one for section in sections.values() for one in section.figures)
    return next(one for one in found if one.name == f"predictability-{name}")


def test_means_of_ensembles_have_students_interval_over_members(sections: dict[str, Section]) -> None:
    shown = table(sections, f"means-{SCENE}")
    assert shown.head == ("ensemble", "members", *(words for words, *_ in QUANTITIES.values()))
    expected = []
    for label, (means, less) in ENSEMBLES.items():
        cells = []
        for mean, (_, _, _, scatter, factor) in zip(means, QUANTITIES.values(), strict=True):
            half = student_quantile(0.025, 23) * less * scatter / math.sqrt(23)
            cells.append(f"{factor * mean:.3g} ± {factor * half:.1g}")
        expected.append((label, "24", *cells))
    assert list(shown.rows) == expected


def welch(mean: float, scatter: float, other: float, of_other: float) -> tuple[float, float]:
    """Return how many times its uncertainty a difference of two means is, and the degrees of freedom."""
    one, two = scatter**2 / 23, of_other**2 / 23
    return (mean - other) / math.sqrt(one + two), 23 * (one + two) ** 2 / (one**2 + two**2)


def told(p: float) -> str:
    return f"{p:.3f}" if p >= 0.001 else "< 0.001"


def expected_tests(label: str) -> tuple[list[tuple[str, ...]], str]:
    """Return the lines of an ensemble in the table of tests, and its joint p."""
    twin = PAIRS[label][0]
    (means, less), (others, _) = ENSEMBLES[label], ENSEMBLES[twin]
    lines, alone, distance = list[tuple[str, ...]](), list[float](), 0.0
    for mean, other, (words, margin, is_part, size, _) in zip(
        means, others, QUANTITIES.values(), strict=True
    ):
        scatter = less * size
        t, freedom = welch(mean, scatter, other, scatter)
        alone.append(2 * student_tail(abs(t), freedom))
        distance += t**2
        half = student_quantile(0.05, freedom) * scatter * math.sqrt(2 / 23)
        ends = (mean - other, mean - other - half, mean - other + half)
        up, down = (1 + margin, 1 - margin) if is_part else (1.0, 1.0)
        shift = 0.0 if is_part else margin
        above = welch(up * other + shift, up * scatter, mean, scatter)
        below = welch(mean, scatter, down * other - shift, down * scatter)
        beyond = max(student_tail(*above), student_tail(*below))
        per_cent = [100 * end / other for end in ends]
        difference = (
            "{:+.2f} % ({:+.2f} to {:+.2f})".format(*per_cent)
            if is_part
            else "{:+.3f} ({:+.3f} to {:+.3f})".format(*ends)
        )
        lines.append((label, words, "5 %" if is_part else "0.1", difference, told(beyond)))
    joint = fisher_tail(distance * (46 - 3 + 1) / (46 * 3), 3, 44)
    corrected = holm([*alone, joint])
    rows: list[tuple[str, ...]] = [
        (*line[:4], told(p), line[4]) for line, p in zip(lines, corrected, strict=False)
    ]
    return rows, told(corrected[3])


def holm(p: list[float]) -> list[float]:
    """Return each p times as many as there are that are no smaller, and no less than a smaller one "
    "becomes."""
    out, least = [0.0] * len(p), 0.0
    for rank, k in enumerate(sorted(range(len(p)), key=p.__getitem__)):
        out[k] = least = max(least, min(1.0, p[k] * (len(p) - rank)))
    return out


def test_every_quantity_of_every_pair_is_tested(sections: dict[str, Section]) -> None:
    shown = table(sections, f"tests-{SCENE}")
    assert shown.head == ("ensemble", "quantity", "margin", "difference", "p (same)", "p (beyond the margin)")
    assert list(shown.rows) == [line for label in PAIRS for line in expected_tests(label)[0]]


def test_the_verdict_on_a_pair_is_told_with_its_joint_test(sections: dict[str, Section]) -> None:
    shown = table(sections, f"verdicts-{SCENE}")
    counts = ("quantities", "told apart", "within their margins", "verdict")
    assert shown.head == ("ensemble", "twin", "members each", "p (joint)", *counts)
    assert list(shown.rows) == [
        (label, twin, "24", expected_tests(label)[1], "3", apart, within, verdict)
        for label, (twin, verdict, apart, within) in PAIRS.items()
    ]
    assert sections[f"ensembles-{SCENE}"].text[2:] == (
        f"{LESS} and {OWN} on {SCENE} differ in impact speed (24 members each).",
        f"Whether {OTHER} and {OWN} on {SCENE} are equivalent is open in impact speed: 24 members each are "
        "too few.",
        f"{EXUDYN} and {OWN} on {SCENE} are equivalent in all 3 quantities, and not told apart (24 "
        "members each).",
        f"{PYMUNK} and its model twin on {SCENE} are equivalent in all 3 quantities, though they are told "
        "apart (24 "
        "members each).",
    )


def test_calibration_tells_alarms_from_power(sections: dict[str, Section]) -> None:
    """Alarms are rare and what is planted, three uncertainties large, is seen mostly."""
    shown = table(sections, f"calibration-{SCENE}")
    power = ("power at the margin", "joint power at the margin", "false equivalence", "power of equivalence")
    assert shown.head == ("members each", "quantity", "false alarm", *power)
    words = [words for words, *_ in QUANTITIES.values()]
    assert [line[:2] for line in shown.rows] == [("24", name) for name in (*words, "jointly", "all together")]
    parts = [
        [float(cell.removesuffix(" %")) if cell != "–" else math.nan for cell in line[2:]]
        for line in shown.rows
    ]
    for alarm, alone, joint, equivalence, clear in parts[:3]:
        assert alarm < 5
        assert alone > 60
        assert joint > 50
        assert equivalence < 10
        assert clear > 60
    (jointly, *none), (together, *absent, all_clear) = parts[3:]
    assert jointly <= together < 8
    assert np.isnan([*none, *absent]).all()
    assert all_clear <= min(line[4] for line in parts[:3])
    assert sections[f"ensembles-{SCENE}"].text[:2] == (
        f"Two samples of 24 members of the reference itself on {SCENE} are told apart in {together:.1f} % "
        "of draws by "
        "any test: alarms mean what they should.",
        f"With 24 members all quantities are found equivalent, rightly, in {all_clear:.0f} % of draws.",
    )


def test_differences_are_drawn_in_parts_of_the_margin(sections: dict[str, Section]) -> None:
    panels = figure(sections, f"ensembles-{SCENE}").drawing.axes
    for panel, (label, (twin, *_)) in zip(panels, PAIRS.items(), strict=True):
        assert (panel.get_title(), panel.get_xlabel()) == (label, "difference / margin")
        _, *lines = panel.lines
        (means, less), (others, _) = ENSEMBLES[label], ENSEMBLES[twin]
        quantities = zip(means, others, QUANTITIES.values(), strict=True)
        for q, (mean, other, (_, margin, is_part, size, _)) in enumerate(quantities):
            whole = margin * (other if is_part else 1.0)
            half = student_quantile(0.05, 46) * less * size * math.sqrt(2 / 23)
            bar, dot = (np.asarray(line.get_xydata()) for line in lines[2 * q : 2 * q + 2])
            assert bar[:, 0] == pytest.approx([(mean - other - half) / whole, (mean - other + half) / whole])
            assert dot[0].tolist() == pytest.approx([(mean - other) / whole, q])
            assert bar[:, 1].tolist() == [q, q]
    names = [text.get_text() for text in panels[0].get_yticklabels()]
    assert names == ["impact speed", "slider deviation from ideal", "mean cosine of impact phase"]


def test_impacts_are_drawn_by_crank_angle_beside_the_twins(sections: dict[str, Section]) -> None:
    panels = figure(sections, f"phases-{SCENE}").drawing.axes
    for panel, label in zip(panels, PAIRS, strict=True):
        labels = (panel.get_xlabel(), panel.get_ylabel())
        assert labels == ("crank angle at impact [°]", "impacts per revolution in 30°")
        for bars, shift, own in zip(panel.containers, (-5.4, 5.4), (True, False), strict=True):
            middle, _, (ends,) = bars
            points = np.asarray(middle.get_xydata())
            place = 6 if own and label == PYMUNK else 1
            # 6 and 10 impacts in four revolutions: 2 in the mean, with a scatter of a half.
            assert points[place].tolist() == pytest.approx([30 * place + 15 + shift, 2.0])
            assert points[:, 1].sum() == pytest.approx(2.0)
            half = student_quantile(0.025, 23) * 0.5 / math.sqrt(23)
            assert ends.get_segments()[place][:, 1] == pytest.approx([2.0 - half, 2.0 + half])


def test_what_did_not_finish_is_counted_by_its_reason(sections: dict[str, Section]) -> None:
    shown = table(sections, "failures")
    assert shown.head == ("scene", "engine", "outcome", "said by", "reason", "runs")
    assert shown.rows == ((SCENE, "scipy (LSODA)", "failed", "the engine", "too slow", "1"),)
    assert sections["failures"].text == ("By its own word an engine failed in 1 of 145 runs.",)
