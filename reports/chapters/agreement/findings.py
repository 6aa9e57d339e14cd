"""What the agreement study's rows say, in sentences: each is made from the rows or checked against them."""

from collections.abc import Iterable, Mapping, Sequence

from reports.chapters.agreement.tables import orders
from reports.convergence import Order
from reports.parts import stated
from reports.quantities import Quantity, signal_errors
from reports.results import Run
from reports.style import Name, ordered, title, words
from reports.tables import in_text

#: Pymunk's two arms: as the library comes, and as an expert runs it.
AS_IT_COMES, TUNED = ("pymunk", "out of the box"), ("pymunk", "tuned")
REFERENCE = "reference"


def orders_found(runs: Sequence[Run], name: Name, quantities: Sequence[Quantity]) -> str:
    """Return the observed orders of an arm on all scenes in one sentence."""
    told = []
    for quantity in quantities:
        found = {
            scene: orders(runs, scene, quantity)[name]
            for scene in sorted({run.scene for run in runs if run.ok and run.name == name})
            if quantity.of_scene(runs, scene)
        }
        claimed = [f"{order} on {scene}" for scene, order in found.items() if order.slope is not None]
        not_claimed = [f"{order} on {scene}" for scene, order in found.items() if order.slope is None]
        part = (
            f"{_signal(quantity)} of order {_list(claimed)}"
            if claimed
            else f"{_signal(quantity)} of no order"
        )
        told.append(part + (f" ({_list(not_claimed)})" if not_claimed else ""))
    return f"{title(name)}: {'; '.join(told)}."


def pymunk_arms(runs: Sequence[Run], quantity: Quantity) -> str | None:
    """Return why Pymunk is shown twice, with its orders, checked; None unless both arms have one."""
    found: dict[Name, list[Order]] = {AS_IT_COMES: [], TUNED: []}
    for scene in sorted({run.scene for run in runs}):
        for name, order in orders(runs, scene, quantity).items():
            if name in found and order.slope is not None:
                found[name].append(order)
    if not all(found.values()):
        return None
    told = {name: _list(dict.fromkeys(map(str, each))) for name, each in found.items()}
    sentence = (
        f"Pymunk is shown twice: {title(AS_IT_COMES)} is the library as it comes, a first-order method "
        f"(observed: {told[AS_IT_COMES]}); {title(TUNED)} is how an expert would run it, with more "
        "iterations, each step's joint error corrected in full and half a kick before the first step, "
        f"which makes it the second-order leap-frog scheme (observed: {told[TUNED]})."
    )
    nearest = {name: {round(o.slope) for o in each if o.slope is not None} for name, each in found.items()}
    return stated(sentence, nearest == {AS_IT_COMES: {1}, TUNED: {2}})


def best_at_step(runs: Sequence[Run], scene: str, step: float) -> str | None:
    """Return who has the smallest error of which signal at a step: of all, and without the reference."""
    here = [run for run in runs if run.ok and (run.scene, run.step_s) == (scene, step)]
    told = []
    for group in (here, [run for run in here if run.engine != REFERENCE]):
        if len({run.engine for run in group}) > 1:
            told.append(_list(f"that of {who} in {what}" for who, what in _winners(group)))
    if not told:
        return None
    sentence = f"On {scene} at a step of {in_text(step)} s the smallest error is {told[0]}"
    return sentence + "".join(f"; without the reference, {more}" for more in told[1:]) + "."


def smallest_first(
    runs: Sequence[Run], steps: Mapping[str, float], quantity: Quantity, per: str = ""
) -> str | None:
    """Return the largest of a quantity over all scenes at one step each, for each arm, smallest first.

    ``per`` names the column that the quantity is divided by.
    """
    worst: dict[Name, float] = {}
    here = [run for run in runs if steps.get(run.scene) == run.step_s]
    failed = [f"{title(run.name)} on {run.scene}" for run in here if not run.ok]
    for run in here:
        value = quantity.value(run)
        if value is not None and (not per or per in run.values):
            worst[run.name] = max(worst.get(run.name, 0.0), value / run.values[per] if per else value)
    if not worst:
        return None
    what, unit = words(quantity.name)
    if per:
        what, unit = f"{what} relative to the {words(per)[0]}", ""
    told = _list(
        f"{in_text(worst[n])}{unit and ' ' + unit} with {title(n)}"
        for n in sorted(worst, key=worst.__getitem__)
    )
    missing = f", without what failed: {_list(failed)}" if failed else ""
    return f"The largest {what} over all scenes is {told}{missing}."


def enough(runs: Sequence[Run], scene: str, setting: str, quantity: Quantity) -> str | None:
    """Return from which value of a setting on the error is as small as it gets, and which values fail."""
    here = sorted((r for r in runs if r.scene == scene), key=lambda r: r.settings[setting])
    seen = [(run.settings[setting], value) for run in here if (value := quantity.value(run)) is not None]
    if not seen:
        return None
    best = min(value for _, value in seen)
    good = [at for at, _ in seen if all(value <= 2 * best for later, value in seen if later >= at)]
    failed = [str(run.settings[setting]) for run in here if not run.ok]
    sentence = f"On {scene} the {_signal(quantity)} error is within a factor of 2 of its smallest "
    sentence += f"from {good[0]} {setting} on" if good else f"at no number of {setting} and all above it"
    return sentence + (f"; runs with {_list(failed)} fail." if failed else "; no run fails.")


def _winners(runs: Sequence[Run]) -> list[tuple[str, str]]:
    """Return who has the smallest error, and of what; at the truth's uncertainty all are equal."""
    found: dict[str, list[str]] = {}
    for quantity in signal_errors(runs):
        values = {run.name: value for run in runs if (value := quantity.value(run)) is not None}
        if values:
            limit = max(min(values.values()), *(quantity.uncertainty(run) or 0.0 for run in runs))
            who = _list(title(name) for name in ordered(values) if values[name] <= limit)
            found.setdefault(who, []).append(_signal(quantity))
    # The one with the most signals comes last, with all those not named before.
    fewest_first = sorted(found, key=lambda who: len(found[who]))
    last = "every other signal" if len(found) > 1 else "every signal"
    return [(who, last if who == fewest_first[-1] else _list(found[who])) for who in fewest_first]


def _signal(quantity: Quantity) -> str:
    return words(quantity.name)[0].replace(" error", "")


def _list(parts: Iterable[str]) -> str:
    """Return parts as a list in a sentence: a, b and c."""
    *most, last = parts
    return f"{', '.join(most)} and {last}" if most else last
