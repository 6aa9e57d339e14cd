"""Ensembles past the horizon, on rows with round numbers: every cell, sentence and point worked out here.

Members scatter by plus and minus one size, in patterns that are orthogonal from quantity to quantity: so
their variance is n/(n - 1) of its square, and quantities are not correlated. In both of the reference's own
ensembles together the first scatters by half the difference of their means besides.
"""

import math
from typing import Any

import numpy as np
import pytest

from reports.chapters import predictability
from reports.parts import Figure, Section, Table
from tests.end_to_end.student import fisher_tail, student_quantile, student_tail
from tests.end_to_end.written_rows import results_of, row

MEMBERS, FEW, TURNS = 32, 24, 4.0
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
    EXUDYN: ((1.001, 3.99e-4, -0.298), 1.0, MEMBERS),
    PYMUNK: ((2.02, 5.01e-4, 0.21), 0.1, MEMBERS),
    SCIPY: ((1.5, 4e-4, -0.3), 1.0, FEW),
}
#: Who is compared with whom, of how many members, and what comes of it.
PAIRS = {
    LESS: (OWN, "32 and 64", "different", "1", "2"),
    OTHER: (OWN, "32 and 32", "open", "0", "2"),
    EXUDYN: (OWN, "32 and 64", "equivalent", "0", "3"),
    PYMUNK: (TWIN, "32 and 32", "equivalent, yet told apart", "2", "3"),
    SCIPY: (ITS_TWIN, "24 and 24", "too few members to decide", "–", "–"),
}
DECIDED = [label for label in PAIRS if label != SCIPY]
SCENE = "clearance-x"


def members() -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Ensembles of one scene: half of the members have 6 impacts at 45°, others 10, and Pymunk's at 195°."""
    rows: list[dict[str, Any]] = []
    curves = {}
    for label, (means, less, count) in ENSEMBLES.items():
        for k in range(count):
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
        row(len(rows), SCENE, "scipy", "Radau", 1e-5, part="scipy (Radau)", member=0, status="failed")
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


def welch(one: Mean, other: Mean, factor: float = 1.0, shift: float = 0.0) -> tuple[float, float]:
    """Return how many times its uncertainty a difference is, the other times a factor, and its freedom."""
    (mean, a, free), (elsewhere, b, freely) = one, other
    b *= factor**2
    t = (mean - factor * elsewhere - shift) / math.sqrt(a + b)
    return t, (a + b) ** 2 / (a**2 / free + b**2 / freely)


def told(p: float) -> str:
    return f"{p:.3f}" if p >= 0.001 else "< 0.001"


def expected_tests(label: str) -> tuple[list[tuple[str, ...]], str]:
    """Return the lines of an ensemble in the table of tests, and its joint p."""
    lines, alone, distance, shares = list[tuple[str, ...]](), list[float](), 0.0, list[float]()
    both = list(zip(ensemble(label), of_twin(label), strict=True))
    for (one, other), (words, margin, is_part, _, _) in zip(both, QUANTITIES.values(), strict=True):
        t, freedom = welch(one, other)
        alone.append(2 * student_tail(abs(t), freedom))
        distance += t**2
        shares.append(one[1] / (one[1] + other[1]))
        half = student_quantile(0.04, freedom) * math.sqrt(one[1] + other[1])
        off = one[0] - other[0]
        up, down, shift = (1 + margin, 1 - margin, 0.0) if is_part else (1.0, 1.0, margin)
        (above, above_free), (below, below_free) = (
            welch(one, other, up, shift),
            welch(one, other, down, -shift),
        )
        beyond = max(student_tail(-above, above_free), student_tail(below, below_free))
        ends = (off, off - half, off + half)
        difference = (
            "{:+.2f} % ({:+.2f} to {:+.2f})".format(*(100 * end / other[0] for end in ends))
            if is_part
            else "{:+.3f} ({:+.3f} to {:+.3f})".format(*ends)
        )
        lines.append((label, words, "5 %" if is_part else "0.1", difference, told(beyond)))
    # Krishnamoorthy and Yu's freedom, of shares of both means in the square of each uncertainty.
    spread = 0.0
    for of, freedom in zip(
        (shares, [1 - share for share in shares]), (both[0][0][2], both[0][1][2]), strict=True
    ):
        spread += (sum(share**2 for share in of) + sum(of) ** 2) / freedom
    freedom = (3 + 9) / spread - 3 + 1
    joint = fisher_tail(distance * freedom / ((3 + 9) / spread * 3), 3, freedom)
    corrected = [min(1.0, len(PAIRS) * p) for p in holm([*alone, joint])]
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


def test_every_quantity_of_every_pair_of_enough_members_is_tested(sections: dict[str, Section]) -> None:
    shown = table(sections, f"tests-{SCENE}")
    assert shown.head == ("ensemble", "quantity", "margin", "difference", "p (same)", "p (beyond the margin)")
    assert list(shown.rows) == [line for label in DECIDED for line in expected_tests(label)[0]]


def joint_p(label: str) -> str:
    return expected_tests(label)[1] if label in DECIDED else "–"


def test_the_verdict_on_a_pair_is_told_with_its_joint_test(sections: dict[str, Section]) -> None:
    shown = table(sections, f"verdicts-{SCENE}")
    counts = ("quantities", "told apart", "within their margins", "verdict")
    assert shown.head == ("ensemble", "twin", "members", "p (joint)", *counts)
    assert list(shown.rows) == [
        (
            label,
            twin,
            sizes,
            expected_tests(label)[1] if label in DECIDED else "–",
            "3",
            apart,
            within,
            verdict,
        )
        for label, (twin, sizes, verdict, apart, within) in PAIRS.items()
    ]
    assert sections[f"ensembles-{SCENE}"].text[2:] == (
        f"{LESS} and {OWN} on {SCENE} differ in impact speed.",
        f"Whether {OTHER} and {OWN} on {SCENE} are equivalent is open in impact speed.",
        f"{EXUDYN} and {OWN} on {SCENE} are equivalent in all 3 quantities, and not told apart.",
        f"{PYMUNK} and its model twin on {SCENE} are equivalent in all 3 quantities, though they are told "
        "apart.",
        f"Nothing is said of {SCIPY} and its model twin on {SCENE}: 24 and 24 members are too few to decide.",
    )


def per_cent(cell: str) -> float:
    return float(cell.removesuffix(" %")) if cell != "–" else math.nan


def test_calibration_tells_alarms_from_power(sections: dict[str, Section]) -> None:
    """Alarms are rare; what decides sees the other mechanism, and clears what is the same."""
    shown = table(sections, f"calibration-{SCENE}")
    power = ("power to see a tenth less clearance", "false equivalence", "power of equivalence")
    assert shown.head == ("members", "quantity", "false alarm", *power)
    words = (*(words for words, *_ in QUANTITIES.values()), "jointly", "all together")
    sizes = ("32 and 64", "32 and 32", "24 and 24")
    assert [line[:2] for line in shown.rows] == [(size, name) for size in sizes for name in words]
    parts = np.array([[per_cent(cell) for cell in line[2:]] for line in shown.rows]).reshape(3, 5, 4)
    for (*quantities, jointly, together), least in zip(parts.tolist(), (80.0, 80.0, 0.0), strict=True):
        alarms, seen, false, clear = np.transpose(quantities)
        assert max(alarms) <= together[0] <= 1.3  # a fifth of the level, and counting
        assert seen[0] > 99
        assert max(seen[1:]) < 10, "it differs in the first alone"
        assert max(false) < 5
        assert jointly[0] <= together[0]
        assert np.isnan([*jointly[2:], together[2]]).all()
        assert least <= together[3] <= min(clear)
    assert parts[2, 4, 3] < 80, "too few to decide"
    alarm, false = parts[:2, 4, 0].max(), parts[:2, :3, 2].max()
    assert sections[f"ensembles-{SCENE}"].text[:2] == (
        f"Members of the reference itself on {SCENE} are told apart in {alarm:.1f} % of draws at the most, "
        "of 1 % that may be.",
        f"Means on {SCENE} that are a margin apart are called equivalent in {false:.1f} % of draws at the "
        "most, of 5 % that may be.",
    )


def test_differences_are_drawn_in_parts_of_the_margin(sections: dict[str, Section]) -> None:
    panels = figure(sections, f"ensembles-{SCENE}").drawing.axes
    for panel, label in zip(panels, PAIRS, strict=True):
        assert (panel.get_title(), panel.get_xlabel()) == (label, "difference / margin")
        _, *lines = panel.lines
        if label not in DECIDED:
            assert not lines
            assert [text.get_text() for text in panel.texts] == ["too few members to decide"]
            continue
        both = zip(ensemble(label), of_twin(label), QUANTITIES.values(), strict=True)
        for q, (one, other, (_, margin, is_part, _, _)) in enumerate(both):
            whole, off = margin * (other[0] if is_part else 1.0), one[0] - other[0]
            half = student_quantile(0.04, welch(one, other)[1]) * math.sqrt(one[1] + other[1])
            bar, dot = (np.asarray(line.get_xydata()) for line in lines[2 * q : 2 * q + 2])
            assert bar[:, 0] == pytest.approx([(off - half) / whole, (off + half) / whole])
            assert dot[0].tolist() == pytest.approx([off / whole, q])
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
            count = int(PAIRS[label][1].split(" and ")[0 if own else 1])
            half = student_quantile(0.025, count - 1) * 0.5 / math.sqrt(count - 1)
            assert ends.get_segments()[place][:, 1] == pytest.approx([2.0 - half, 2.0 + half])


def test_what_did_not_finish_is_counted_by_its_reason(sections: dict[str, Section]) -> None:
    shown = table(sections, "failures")
    assert shown.head == ("scene", "engine", "outcome", "said by", "reason", "runs")
    assert shown.rows == ((SCENE, "scipy (Radau)", "failed", "the engine", "too slow", "1"),)
    assert sections["failures"].text == ("1 of 241 runs did not finish.",)
