"""The picture of a sweep: which one is decided by how many fields were varied."""

from collections.abc import Sequence

import matplotlib as mpl
import pandas as pd

from reports.plots.sweeps.basins import draw_basins
from reports.plots.sweeps.histogram import draw_histogram
from reports.plots.sweeps.one_field import draw_over_field
from reports.plots.sweeps.two_fields import draw_map
from reports.run.picture import Picture
from reports.style import RC

EXPONENT, STROBE, PHASE, FORCE = "exponent_1_s", "strobe_m", "impact_phase_rad", "largest_contact_force_N"
#: What is shown over the start: in which motion a member ends, seen in the last half of so many turns.
MOTION, FEWEST_TURNS = "motion", 10
#: Fields that a picture has axes for.
MOST_FIELDS = 2
SPEED = "start.crank_speed_rad_s"
#: Columns that say which member it is and how it ended.
HEAD = ("member", "direction", "status", "reason")


class NoPicture(ValueError):
    """There is no picture of this; the message says of what there is one."""


def sweep_picture(frame: pd.DataFrame, varied: Sequence[str], title: str, show: str | None = None) -> Picture:
    """Return the picture of a sweep's rows: of a column to ``show``, or of what is looked at first.

    Of one field that is the slider's deviation once a turn, with the exponent if there is one; of two of the
    start the basins of attraction, of two others a map of the exponent, or of the peak force; without any the
    impacts by crank angle. Chains up and down are told apart by their colours.

    Raises:
        NoPicture: more fields were varied, or the column is none that can be drawn.
    """
    columns = [column for column in frame if column not in (*HEAD, *varied)]
    columns += [MOTION] * (len(varied) == 2)
    if show is not None and show not in columns:
        raise NoPicture(f"expected one of {', '.join(columns)}, got {show}")
    if len(varied) > MOST_FIELDS:
        raise NoPicture(f"expected one or two fields with --vary for a picture, got {len(varied)}")
    done = frame[frame["status"] == "ok"]
    if done.empty:
        raise NoPicture("expected members that did not fail, got none")
    if (turns := done[STROBE].map(len).min()) < (fewest := fewest_turns(varied, show)):
        raise NoPicture(f"expected members of {fewest} turns for this picture, got {turns}")
    column = show or (FORCE if varied else PHASE)
    if column in done and done[column].explode().isna().all():  # motions are no column
        raise NoPicture(f"expected members with a number in {column}, got none")
    with mpl.rc_context(RC):
        if len(varied) == 2:
            picture = _over_two(frame, (varied[0], varied[1]), show)
        elif len(varied) == 1:
            first = [STROBE, *([EXPONENT] if done[EXPONENT].notna().any() else [])]
            picture = draw_over_field(done, varied[0], [show] if show else first)
        else:
            picture = draw_histogram(done, show or PHASE)
        failed = len(frame) - len(done)
        picture.suptitle(f"{title}: {len(frame)} members" + (f", {failed} failed" if failed else ""), size=9)
    return picture


def fewest_turns(varied: Sequence[str], show: str | None) -> int:
    """Return how many whole turns of a member the picture of a column, or the first one, is made of."""
    if show == MOTION or (show is None and len(varied) == MOST_FIELDS and _are_of_start(varied)):
        return FEWEST_TURNS
    return int(show == STROBE or (show is None and len(varied) == 1))


def _over_two(frame: pd.DataFrame, fields: tuple[str, str], show: str | None) -> Picture:
    done = frame[frame["status"] == "ok"]
    if show == MOTION or (show is None and _are_of_start(fields)):
        return draw_basins(frame, fields)
    shown = show or (EXPONENT if done[EXPONENT].notna().any() else FORCE)
    if _is_list(done, shown):
        raise NoPicture(f"expected a column with one number a member for a map, got {shown}")
    return draw_map(frame, fields, shown)


def _are_of_start(fields: Sequence[str]) -> bool:
    return all(field.startswith("start.") and field != SPEED for field in fields)


def _is_list(rows: pd.DataFrame, column: str) -> bool:
    return not pd.api.types.is_numeric_dtype(rows[column])
