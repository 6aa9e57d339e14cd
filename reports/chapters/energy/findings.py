"""What the energy study's rows say, in sentences: each is made from the rows or checked against them."""

from collections.abc import Iterable, Mapping, Sequence

from reports.chapters.energy.runs import (
    DISSIPATED,
    POWER,
    at_rung,
    half_width,
    has_clearance,
    is_told,
    resolution,
)
from reports.parts import stated
from reports.results import Run
from reports.style import Name, title
from reports.tables import in_text

PLAIN, BAUMGARTE, PROJECTED = (
    ("reference", "none"),
    ("reference", "Baumgarte"),
    ("reference", "projection"),
)
AS_IT_COMES = ("pymunk", "out of the box")
#: How far an exponent of time may be from the whole number that theory gives, and still be that.
EXPONENT = 0.1


def hidden_power(runs: Sequence[Run], scene: str, rung: float) -> str | None:
    """Return the hidden power of every arm on a scene, smallest first, and what is not told from zero."""
    here = [run for run in at_rung(runs, {scene: rung}) if run.ok]
    here.sort(key=lambda run: abs(run.values[POWER]))
    if not here:
        return None
    told = [run for run in here if is_told(run)]
    rest = [f"{title(run.name)} (± {in_text(half_width(run))} W)" for run in here if run not in told]
    sizes = [f"{_signed(run.values[POWER])} W with {title(run.name)}" for run in told]
    sentence = f"On {scene} at {resolution(runs, scene, rung)} the hidden power is "
    sentence += _list(sizes) if sizes else "not told from zero with any arm"
    if sizes and rest:
        sentence += f"; it is not told from zero with {_list(rest)}"
    dissipated = [run.values[DISSIPATED] for run in here if has_clearance(run)]
    if dissipated:
        sentence += f". The contacts dissipate {_span(map(in_text, (min(dissipated), max(dissipated))))} W"
    return f"{sentence}."


def lost_as_it_comes(runs: Sequence[Run], scene: str) -> str | None:
    """Return how much of a scene's energy Pymunk with its own settings loses, by step."""
    here = [run for run in runs if run.ok and run.name == AS_IT_COMES and run.scene == scene]
    here.sort(key=lambda run: -run.step_s)
    if not here:
        return None
    parts = [run.values["largest_numerical_gain_J"] / run.values["largest_kinetic_energy_J"] for run in here]
    shown = [
        f"{100 * part:.0f} % at a step of {in_text(run.step_s)} s"
        for part, run in zip(parts, here, strict=True)
    ]
    return f"On {scene} {title(AS_IT_COMES)} loses {_list(shown)} of the largest kinetic energy by the end."


def drift(runs: Sequence[Run]) -> list[str]:
    """Return, checked, how the reference's constraints drift with each stabilisation."""
    ideal = [run for run in runs if run.ok and not has_clearance(run)]
    out = []
    plain = _exponents(ideal, PLAIN)
    if plain:
        gaps, speeds = (_span(f"{e:.2f}" for e in (min(of), max(of))) for of in zip(*plain, strict=True))
        sentence = (
            "Without stabilisation the reference's constraints drift as theory has it for RK4: the speeds at "
            f"which gaps open grow in proportion to time (exponents {speeds} in "
            f"{len(plain)} runs), the gaps with its square ({gaps})."
        )
        holds = all(abs(gap - 2) < EXPONENT and abs(speed - 1) < EXPONENT for gap, speed in plain)
        out.append(stated(sentence, holds))
    bounded = _exponents(ideal, BAUMGARTE)
    if bounded:
        largest = max(max(pair) for pair in bounded)
        sentence = f"Baumgarte's stabilisation bounds them: exponents are at most {max(0.0, largest):.2f}."
        out.append(stated(sentence, largest < EXPONENT))
    projected = [run for run in ideal if run.name == PROJECTED]
    if projected:
        worst = max(run.values["constraint_violation_m"] for run in projected)
        sentence = f"Projection leaves round-off alone: gaps of at most {in_text(worst)} m."
        out.append(stated(sentence, not any("constraint_violation_exponent" in r.values for r in projected)))
    return out


def ledger_closes(runs: Sequence[Run], rungs: Mapping[str, float]) -> str | None:
    """Return the largest part of what contacts dissipate that is missing or too much, by arm."""
    worst: dict[Name, float] = {}
    for run in at_rung(runs, rungs):
        if run.ok and run.values.get(DISSIPATED):
            part = abs(run.values["mean_hidden_power_W"]) / run.values[DISSIPATED]
            worst[run.name] = max(part, worst.get(run.name, 0.0))
    if not worst:
        return None
    told = _list(f"{in_text(worst[n])} with {title(n)}" for n in sorted(worst, key=worst.__getitem__))
    return f"Of what contacts dissipate, the part that the ledger lacks or has too much is at most {told}."


def _exponents(runs: Sequence[Run], name: Name) -> list[tuple[float, float]]:
    """Return the exponents of gap and gap speed of an arm's runs that have them."""
    names = ("constraint_violation_exponent", "constraint_speed_exponent")
    found = [run.values for run in runs if run.name == name]
    return [(v[names[0]], v[names[1]]) for v in found if all(n in v for n in names)]


def _signed(value: float) -> str:
    return f"{'−' if value < 0 else '+'}{in_text(abs(value))}"


def _span(ends: Iterable[str]) -> str:
    """Return two ends as a range, or as one number if they read the same."""
    return " to ".join(dict.fromkeys(ends))


def _list(parts: Iterable[str]) -> str:
    *most, last = parts
    return f"{', '.join(most)} and {last}" if most else last
